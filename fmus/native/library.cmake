# add_fmi_library(NAME SOURCE...): the shared library of a model behind the FMI fronts, in NAME with the suffix of the
# platform. The FMI headers are those in the folder FMI_HEADERS, by default the copies in headers/.

set(FMI_HEADERS "" CACHE PATH "Folder of fmi2Functions.h and fmi3Functions.h; empty for the copies in headers/")
if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release)
endif()

function(add_fmi_library name)
  set(headers ${FMI_HEADERS})
  if(NOT headers)
    # A copy is the three headers of a version in one; FMUs must not hold the standard's files under their own names.
    set(headers ${CMAKE_CURRENT_BINARY_DIR}/headers)
    foreach(version 2 3)
      set(copy ${CMAKE_CURRENT_SOURCE_DIR}/headers/fmi${version}.h)
      if(EXISTS ${copy})
        configure_file(${copy} ${headers}/fmi${version}Functions.h COPYONLY)
      endif()
    endforeach()
  endif()

  add_library(${name} SHARED ${ARGN})
  target_include_directories(${name} PRIVATE ${headers})
  set_target_properties(${name} PROPERTIES PREFIX "" C_VISIBILITY_PRESET hidden C_EXTENSIONS OFF)
  if(MSVC)
    set_target_properties(${name} PROPERTIES C_STANDARD 11)
  else()
    set_target_properties(${name} PROPERTIES C_STANDARD 99)
    # Without fused multiply-adds every platform computes the same bits.
    target_compile_options(${name} PRIVATE -ffp-contract=off -fno-math-errno)
  endif()
  if(UNIX)
    target_link_libraries(${name} PRIVATE m)
  endif()
endfunction()
