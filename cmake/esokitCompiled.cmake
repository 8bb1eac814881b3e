# esokit::compiled, of the source file ${esokit_source}: built by the project that links it and with its
# options, as a library of ours could not know its -march, its C++ library or its sanitizers.
add_library(esokit_compiled STATIC EXCLUDE_FROM_ALL "${esokit_source}")
add_library(esokit::compiled ALIAS esokit_compiled)
target_link_libraries(esokit_compiled PUBLIC esokit::esokit)
target_compile_definitions(esokit_compiled PUBLIC ESOKIT_COMPILED)
set_target_properties(esokit_compiled PROPERTIES POSITION_INDEPENDENT_CODE ON)
# A user's warnings are about the user's code.
if(TARGET esokit_warnings)
  target_link_libraries(esokit_compiled PRIVATE esokit_warnings)
else()
  target_compile_options(esokit_compiled PRIVATE $<IF:$<CXX_COMPILER_ID:MSVC>,/w,-w>)
endif()
# More sections than an object file of Windows holds otherwise.
if(MINGW)
  target_compile_options(esokit_compiled PRIVATE -Wa,-mbig-obj)
elseif(MSVC)
  target_compile_options(esokit_compiled PRIVATE /bigobj)
endif()
