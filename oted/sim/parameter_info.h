#pragma once
/// What a simulator tells about the numbers behind its parameter paths.

#include <string>
#include <vector>

namespace oted {

/// One number that a path reaches.
struct ParameterPlace {
  std::string path;  ///< "geom/foot_geom/friction[0]"
  double nominal = 0;
};

/// What one path stands for: everything that it matches.
struct PathInfo {
  std::vector<ParameterPlace> places;  ///< at least one
  std::string unit;                    ///< of the values; "" where they have none
  std::string meaning;                 ///< "sliding friction"
  /// How far from 0 its values may be thought to lie, where the simulator can tell although all are 0; otherwise 0.
  double reach = 0;
};

/// A field that a simulator offers as a parameter, with the values that it has.
struct ParameterOffer {
  std::string owner;  ///< "geom": the path's first word
  std::string path;   ///< "geom/NAME/friction[k]": NAME and k to be filled in
  std::string unit;
  std::string meaning;
  std::vector<ParameterPlace> places;
};

}  // namespace oted
