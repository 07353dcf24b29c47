# SPDX-License-Identifier: BSD-3-Clause
# Compiles for the chip. The compiler is gcc-arm-none-eabi, which nothing else needs.
set(chip_compiler arm-none-eabi-g++)
set(chip_machine -mcpu=cortex-m0plus -mthumb)
set(chip_options -std=c++17 -ffreestanding -fbuiltin -fno-exceptions -fno-rtti
    -fno-threadsafe-statics -ffunction-sections -fdata-sections
    -Wall -Wextra -Wshadow -Wconversion $<$<BOOL:${VERSAVIS_WERROR}>:-Werror>
    -ffile-prefix-map=${PROJECT_SOURCE_DIR}/=
    -I${PROJECT_SOURCE_DIR}/firmware/core -I${PROJECT_SOURCE_DIR}/libversavis
    -DVERSAVIS_VERSION="${PROJECT_VERSION}")

# chip_object(SOURCE FOLDER OPTIONS...): appends the object, in this folder, to `objects`.
function(chip_object source folder)
    cmake_path(GET source STEM name)
    set(object ${folder}/${name}.o)
    add_custom_command(OUTPUT ${object}
        COMMAND ${CMAKE_COMMAND} -E make_directory ${folder}
        COMMAND ${chip_compiler} ${chip_machine} ${chip_options} ${ARGN} -MD -MF ${object}.d
            -c ${source} -o ${object}
        DEPENDS ${source} DEPFILE ${object}.d COMMAND_EXPAND_LISTS VERBATIM)
    set(objects ${objects} ${object} PARENT_SCOPE)
endfunction()

# chip_core(FOLDER): the objects of the portable core.
function(chip_core folder)
    get_target_property(sources versavis_firmware_core SOURCES)
    foreach(source IN LISTS sources)
        chip_object(${PROJECT_SOURCE_DIR}/firmware/${source} ${folder} -Os)
    endforeach()
    set(objects ${objects} PARENT_SCOPE)
endfunction()

# chip_memory_functions(FOLDER): what the compiler expects of every platform. Of loops that copy, it
# would make calls of these functions.
function(chip_memory_functions folder)
    chip_object(${PROJECT_SOURCE_DIR}/firmware/replay/image/memory.cpp ${folder} -O2
        -fno-tree-loop-distribute-patterns)
    set(objects ${objects} PARENT_SCOPE)
endfunction()
