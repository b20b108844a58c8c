#pragma once
/// One array of NumPy's .npy format (versions 1 to 3), to and from bytes. Never unpickles, never evaluates.

#include <cstdint>
#include <string>
#include <string_view>

#include "oted/data/npz.h"

namespace oted {

/// Parses a whole .npy file. Little-endian bool, integers and floats, C or Fortran order; comes out in C order.
/// `where` names the array in errors. @throws DataError
NpyArray ParseNpy(std::string_view bytes, const std::string& where);

/// The array as a version 1.0 .npy file.
std::string NpyBytes(const NpyArray& array);

}  // namespace oted
