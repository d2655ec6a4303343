# find_package(allan_core) defines the target allan_core::allan_core.
get_filename_component(_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
if(NOT TARGET allan_core::allan_core)
  add_library(allan_core::allan_core STATIC IMPORTED)
  set_target_properties(allan_core::allan_core PROPERTIES
    IMPORTED_LOCATION "${_prefix}/lib/liballan_core.a"
    INTERFACE_INCLUDE_DIRECTORIES "${_prefix}/include")
  if(UNIX)
    set_property(TARGET allan_core::allan_core PROPERTY INTERFACE_LINK_LIBRARIES "m;pthread;dl")
  endif()
endif()
unset(_prefix)
