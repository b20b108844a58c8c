# Warnings, sanitizers and optimisation that every target of ours uses; never forced on those who link the library.
add_library(oted_warnings INTERFACE)
target_compile_options(oted_warnings INTERFACE -Wall -Wextra -Wshadow -Wnon-virtual-dtor)
if(OTED_WARNINGS_AS_ERRORS)
  target_compile_options(oted_warnings INTERFACE -Werror)
endif()
if(OTED_SANITIZE)
  # The checks left out cost a third of the compiler's time; what they find, the address sanitizer or a crash shows too.
  add_compile_options(-fsanitize=${OTED_SANITIZE} -fno-sanitize=vptr,null,alignment,object-size
                      -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${OTED_SANITIZE})
endif()

# sqrt and friends need no errno; with it, loops that call them do not vectorise.
add_compile_options(-fno-math-errno)
