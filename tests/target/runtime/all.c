/* A whole design, see design.h. */
#define DESIGN_HEADER "design.h"
#include <esokit/target/runtime/head.c>
#include <esokit/target/runtime/recorded.c>
#include <esokit/target/runtime/law.c>
#include <esokit/target/runtime/design.c>
#include <esokit/target/runtime/observer.c>
#include <esokit/target/runtime/measured.c>
#include <esokit/target/runtime/core.c>
#include <esokit/target/runtime/angle.c>
#include <esokit/target/runtime/layers.c>
#include <esokit/target/runtime/map.c>
#include <esokit/target/runtime/guard.c>
#include <esokit/target/runtime/predictive.c>
#include <esokit/target/runtime/rest.c>
#include <esokit/target/runtime/controller.c>
