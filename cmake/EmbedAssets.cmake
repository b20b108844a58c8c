# Writes text files into a C++ source as string literals, so that an installed program needs none of them:
#   cmake -D OUTPUT=page_assets.cc -D HEADER=oted/report/page_assets.h -D FOLDER=.../assets
#         -D ASSETS="PageStyle=page.css,PlotsScript=plots.js" -P EmbedAssets.cmake
# Each becomes a function of HEADER that returns the file's text.
set(source "#include \"${HEADER}\"\n\nnamespace oted {\n")
string(REPLACE "," ";" pairs "${ASSETS}")
foreach(pair IN LISTS pairs)
  string(REGEX MATCH "^([A-Za-z]+)=(.+)$" matched "${pair}")
  set(function "${CMAKE_MATCH_1}")
  set(file "${FOLDER}/${CMAKE_MATCH_2}")
  file(READ "${file}" text)
  string(FIND "${text}" ")asset\"" end)
  if(NOT matched OR NOT end EQUAL -1)
    message(FATAL_ERROR "'${file}' cannot be embedded: it holds )asset\", which ends the literal")
  endif()
  string(APPEND source "\nstd::string_view ${function}() { return R\"asset(${text})asset\"; }\n")
endforeach()
string(APPEND source "\n}  // namespace oted\n")
file(WRITE "${OUTPUT}" "${source}")
