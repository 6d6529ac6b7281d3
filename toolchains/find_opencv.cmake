# stillmesh_find_opencv(component ...): OpenCV's own package file, or, where only its parts are installed (a sysroot, a
# board: that file refuses to work unless every last library of OpenCV is there), its libraries one by one as
# imported targets of the same names.
function(stillmesh_find_opencv)
    if(NOT CMAKE_CROSSCOMPILING)
        find_package(OpenCV QUIET COMPONENTS ${ARGN})
    endif()
    if(OpenCV_FOUND)
        set(OpenCV_INCLUDE_DIRS ${OpenCV_INCLUDE_DIRS} PARENT_SCOPE)
        return()
    endif()
    find_path(STILLMESH_OPENCV_INCLUDE_DIR opencv2/core.hpp PATH_SUFFIXES opencv4 REQUIRED)
    foreach(component IN LISTS ARGN)
        find_library(STILLMESH_OPENCV_${component} opencv_${component} REQUIRED)
        if(NOT TARGET opencv_${component})
            add_library(opencv_${component} SHARED IMPORTED GLOBAL)
            set_target_properties(opencv_${component} PROPERTIES
                IMPORTED_LOCATION ${STILLMESH_OPENCV_${component}}
                INTERFACE_SYSTEM_INCLUDE_DIRECTORIES ${STILLMESH_OPENCV_INCLUDE_DIR}
                INTERFACE_INCLUDE_DIRECTORIES ${STILLMESH_OPENCV_INCLUDE_DIR})
        endif()
    endforeach()
    set(OpenCV_INCLUDE_DIRS ${STILLMESH_OPENCV_INCLUDE_DIR} PARENT_SCOPE)
endfunction()
