# What `cmake --install` puts where of libstillmesh-dev and libstillmesh-c0: libraries, headers, how to find them. With
# STILLMESH_ENGINE_ONLY too.
include(CMakePackageConfigHelpers)
set(packaging ${PROJECT_SOURCE_DIR}/packaging)
set(include_folder ${CMAKE_INSTALL_INCLUDEDIR}/stillmesh)
set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/stillmesh)
set(share_folder ${CMAKE_INSTALL_DATADIR}/stillmesh)
set(pkgconfig_folder ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

set(installed_targets stillmesh_engine stillmesh_engine_headers)
set(pkgconfig_libraries -lstillmesh-engine)
set(other_headers ${STILLMESH_LIBRARY_HEADERS})
if(TARGET stillmesh_cpu_kernels)
    list(APPEND installed_targets stillmesh_cpu_kernels)
    string(PREPEND pkgconfig_libraries "-lstillmesh-cpu-kernels ")
    list(APPEND other_headers platform/linux/cpu_kernels.hpp platform/linux/memory_block.hpp)
endif()
install(TARGETS ${installed_targets} EXPORT stillmesh_targets
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library
    INCLUDES DESTINATION ${include_folder})
if(TARGET stillmesh_c)
    install(TARGETS stillmesh_c EXPORT stillmesh_targets
        LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT runtime NAMELINK_COMPONENT library
        INCLUDES DESTINATION ${include_folder})
    install(FILES ${PROJECT_SOURCE_DIR}/platform/c_api/stillmesh.h DESTINATION ${include_folder} COMPONENT library)
endif()
list(TRANSFORM STILLMESH_PUBLIC_HEADERS PREPEND engine/ OUTPUT_VARIABLE headers)
foreach(header IN LISTS headers other_headers)
    get_filename_component(folder ${header} DIRECTORY)
    install(FILES ${PROJECT_SOURCE_DIR}/${header} DESTINATION ${include_folder}/${folder} COMPONENT library)
endforeach()
install(FILES ${PROJECT_SOURCE_DIR}/vocabulary/default.voc DESTINATION ${share_folder} COMPONENT library)

install(EXPORT stillmesh_targets NAMESPACE stillmesh:: FILE stillmesh-targets.cmake
    DESTINATION ${package_folder} COMPONENT library)
set(vocabulary_file ${share_folder}/default.voc)
configure_package_config_file(${packaging}/stillmesh-config.cmake.in ${PROJECT_BINARY_DIR}/stillmesh-config.cmake
    INSTALL_DESTINATION ${package_folder} PATH_VARS vocabulary_file NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/stillmesh-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/stillmesh-config.cmake ${PROJECT_BINARY_DIR}/stillmesh-config-version.cmake
    DESTINATION ${package_folder} COMPONENT library)
# The prefix is where the file lies and not where it was configured for: `cmake --install --prefix` and an unpacked package
# are found as well.
file(RELATIVE_PATH stillmesh_to_prefix "/${pkgconfig_folder}" "/")
string(REGEX REPLACE "/$" "" stillmesh_to_prefix "${stillmesh_to_prefix}")
function(stillmesh_install_pkgconfig pkgconfig_name description)
    configure_file(${packaging}/stillmesh.pc.in ${PROJECT_BINARY_DIR}/${pkgconfig_name}.pc @ONLY)
    install(FILES ${PROJECT_BINARY_DIR}/${pkgconfig_name}.pc DESTINATION ${pkgconfig_folder} COMPONENT library)
endfunction()
stillmesh_install_pkgconfig(stillmesh "${PROJECT_DESCRIPTION}")
if(TARGET stillmesh_c)
    set(pkgconfig_libraries -lstillmesh_c)
    stillmesh_install_pkgconfig(stillmesh-c "${PROJECT_DESCRIPTION}: for C")
endif()
