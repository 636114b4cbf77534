# SPDX-License-Identifier: Apache-2.0
# Manuals are text files. The build turns each FOLDER/NAME.txt into generated/manual/NAME.h, which
# defines MANUAL_NAME as a string literal. In a file, lines of a paragraph are joined by the build;
# paragraphs are divided by an empty line, and a line that begins with two blanks stays as it is.

if(NOT CMAKE_SCRIPT_MODE_FILE)
    set(manual_script ${CMAKE_CURRENT_LIST_FILE})

    # embed_manuals(TARGET FOLDER [RAW]): the headers of all texts in a folder of the present
    # directory; RAW: every line stays as it is
    function(embed_manuals target folder)
        file(GLOB texts CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/*.txt)
        foreach(text ${texts})
            get_filename_component(name ${text} NAME_WE)
            set(header ${CMAKE_BINARY_DIR}/generated/manual/${name}.h)
            add_custom_command(OUTPUT ${header} DEPENDS ${text} ${manual_script} VERBATIM
                COMMAND ${CMAKE_COMMAND} -D TEXT=${text} -D HEADER=${header} -D RAW=${ARGV2}
                        -P ${manual_script})
            target_sources(${target} PRIVATE ${header})
        endforeach()
    endfunction()

    # embed_pages(TARGET NAME...): generated/manual/NAME_page.h with the manual page
    # coman-hil-NAME(5) as Markdown, MANUAL_NAME_PAGE
    function(embed_pages target)
        foreach(name ${ARGN})
            set(text ${PROJECT_SOURCE_DIR}/docs/man/coman-hil-${name}.5.scd)
            set(header ${CMAKE_BINARY_DIR}/generated/manual/${name}_page.h)
            add_custom_command(OUTPUT ${header} DEPENDS ${text} ${manual_script} VERBATIM
                COMMAND ${CMAKE_COMMAND} -D TEXT=${text} -D HEADER=${header} -D RAW=RAW
                        -D PAGE=${name} -P ${manual_script})
            target_sources(${target} PRIVATE ${header})
        endforeach()
    endfunction()
    return()
endif()

# As a script: TEXT to HEADER
file(READ ${TEXT} text)
get_filename_component(name ${TEXT} NAME_WE)
string(TOUPPER ${name} symbol)

# Lines of a paragraph become one; the end of the file is no line
string(REGEX REPLACE "\n+$" "" text "${text}")
if(NOT RAW)
    string(REGEX REPLACE "([^\n])\n([^\n ])" "\\1 \\2" text "${text}")
endif()

# scdoc to Markdown: headings, a key with its paragraphs as an entry of a list, emphasis
if(PAGE)
    set(name ${PAGE}_page)
    string(TOUPPER ${name} symbol)
    string(FIND "${text}" "\n" end)
    string(SUBSTRING "${text}" ${end} -1 text)
    string(REGEX REPLACE "\n# " "\n## " text "${text}")
    string(REGEX REPLACE "\n\t" "\n  " text "${text}")
    string(REGEX REPLACE "\n[*]" "\n- *" text "${text}")
    string(REGEX REPLACE "[*]([^*\n]+)[*]" "`\\1`" text "${text}")
    string(REGEX REPLACE "([^a-zA-Z0-9`])_([^_ \n][^_\n]*)_([^a-zA-Z0-9])" "\\1*\\2*\\3"
           text "${text}")
    string(REGEX REPLACE "\\\\([_*.#-])" "\\1" text "${text}")
    string(PREPEND text
           "# Keys of a ${PAGE} file\n\nMade by `coman-hil help ${PAGE} --markdown`.\n")
endif()

# A literal a line
string(REPLACE "\\" "\\\\" text "${text}")
string(REPLACE "\"" "\\\"" text "${text}")
string(REPLACE "\n" "\\n\" \\\n    \"" text "${text}")
file(WRITE ${HEADER} "/* Made from ${name}.txt. */\n#define MANUAL_${symbol} \\\n    \"${text}\"\n")
