# Python is looked for once: ament and every generator do it again, with forty starts of Python.
if(NOT TARGET Python3::NumPy)
  include("${CMAKE_ROOT}/Modules/FindPython3.cmake")
endif()
