# stillmesh_module(NAME LIBRARY SOURCE): a part of the program that it opens when it is asked for it (platform/linux/module.hpp),
# libstillmesh_NAME.so beside the program; SOURCE defines its one function, LIBRARY has the rest. The target is
# stillmesh_NAME_module; all of them are in the global property STILLMESH_MODULES.
set(STILLMESH_MODULE_SYMBOLS ${CMAKE_CURRENT_LIST_DIR}/module.map)
function(stillmesh_module name library source)
    set(target stillmesh_${name}_module)
    add_library(${target} MODULE ${source})
    target_compile_definitions(${target} PRIVATE STILLMESH_PROGRAM_VERSION="${PROJECT_VERSION}")
    target_link_options(${target} PRIVATE -Wl,--version-script=${STILLMESH_MODULE_SYMBOLS} -Wl,--as-needed)
    if(NOT STILLMESH_SANITIZE AND NOT STILLMESH_FUZZ_COVERAGE)  # whose own runtime comes with the program
        target_link_options(${target} PRIVATE -Wl,--no-undefined)
    endif()
    target_link_libraries(${target} PRIVATE stillmesh_contract ${library})
    set_target_properties(${target} PROPERTIES PREFIX lib OUTPUT_NAME stillmesh_${name} SUFFIX .so
        LINK_DEPENDS ${STILLMESH_MODULE_SYMBOLS} LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/platform/cli)
    set_property(GLOBAL APPEND PROPERTY STILLMESH_MODULES ${target})
endfunction()
