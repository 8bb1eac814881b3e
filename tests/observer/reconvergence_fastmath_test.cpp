// The same with -ffast-math.
#include "reconvergence_test.cpp"
