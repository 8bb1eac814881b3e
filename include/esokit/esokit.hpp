/// @file
/// Everything of esokit. Firmware may prefer the headers that it uses, one file an observer.
#pragma once

#include <esokit/control/adrc_law.hpp>
#include <esokit/core/combinatorics.hpp>
#include <esokit/core/error.hpp>
#include <esokit/core/error_text.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/core/version.hpp>
#include <esokit/design/continuous_gain.hpp>
#include <esokit/design/placement.hpp>
#include <esokit/design/sampled_gain.hpp>
#include <esokit/model/integrator_chain.hpp>
#include <esokit/model/scaled_chain.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/continuous_observer.hpp>
#include <esokit/observer/gain_law.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/predictor_corrector.hpp>
