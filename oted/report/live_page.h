#pragma once
/// The page of work that goes on: a browser reads it anew every few seconds.

#include <string>
#include <utility>
#include <vector>

namespace oted {

struct LivePage {
  struct Table {
    std::string title;
    std::vector<std::string> columns;
    std::vector<std::vector<std::string>> rows;
  };
  std::string title, headline;
  std::vector<std::string> text = {};  ///< paragraphs
  std::vector<std::pair<std::string, double>> parts =
      {};                          ///< of one bar, by name: each its share of the whole, up to four
  std::vector<Table> tables = {};  ///< without rows, one is left out
  int refresh_s = 5;

  /// From plain text.
  std::string Html() const;
};

}  // namespace oted
