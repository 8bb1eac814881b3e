// The same with -ffast-math, where a comparison with NaN may go either way.
#include "refused_config_test.cpp"
