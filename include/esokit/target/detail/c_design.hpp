/// @file
/// The files of target/runtime/ of which the C of a design is made.
#pragma once

#include <esokit/target/detail/runtime_text.hpp>
#include <vector>

namespace esokit::detail {

namespace runtime {

inline constexpr const char* header =
#include <esokit/target/runtime/controller.h>
    ;

/// What is called stands before what calls it.
inline const std::vector<const char*> source = {
    head,
#include <esokit/target/runtime/recorded.c>
    ,
#include <esokit/target/runtime/law.c>
    ,
#include <esokit/target/runtime/design.c>
    ,
#include <esokit/target/runtime/observer.c>
    ,
#include <esokit/target/runtime/measured.c>
    ,
#include <esokit/target/runtime/core.c>
    ,
#include <esokit/target/runtime/angle.c>
    ,
#include <esokit/target/runtime/layers.c>
    ,
#include <esokit/target/runtime/map.c>
    ,
#include <esokit/target/runtime/guard.c>
    ,
#include <esokit/target/runtime/predictive.c>
    ,
#include <esokit/target/runtime/rest.c>
    ,
#include <esokit/target/runtime/controller.c>
};

}  // namespace runtime

}  // namespace esokit::detail
