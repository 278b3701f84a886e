# The names of the error codes for C++, from the one table of them: robotd_wmx/error_codes.tsv.
set(ERROR_CODES ${CMAKE_CURRENT_LIST_DIR}/../robotd_wmx/error_codes.tsv)

# Writes `file` with a line CODE(class, type, name) for every row: CODE(Engine, ErrorCode, …).
# More arguments are classes to leave out.
function(write_error_names file)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${ERROR_CODES})
  file(READ ${ERROR_CODES} rows)
  string(REPLACE "class\tcode\tname\ttext\n" "\n" rows "${rows}")
  set(classes "engine>Engine, ErrorCode" "core motion>CoreMotion, CoreMotionErrorCode"
      "advanced motion>AdvancedMotion, AdvancedMotionErrorCode" "io>Io, IOErrorCode"
      "ecat>Ecat, EcErrorCode" "cyclic buffer>CyclicBuffer, CyclicBufferErrorCode")
  foreach(class IN LISTS ARGN)
    string(REGEX REPLACE "\n${class}\t[^\n]*" "" rows "${rows}")
  endforeach()
  foreach(class IN LISTS classes)
    string(REPLACE ">" ";" pair "${class}")
    list(POP_FRONT pair name)
    string(REGEX REPLACE "\n${name}\t[0-9]+\t([A-Za-z0-9]+)\t[^\n]*" "\nCODE(${pair}, \\1)"
           rows "${rows}")
  endforeach()
  file(CONFIGURE OUTPUT ${file} CONTENT "${rows}" @ONLY)
endfunction()
