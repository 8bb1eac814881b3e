// The same with -ffast-math.
#include "pack_test.cpp"
