#include "oted/sim/mujoco/expression.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <muParser.h>

#include <vector>

#include "oted/base/error.h"
#include "oted/base/fields.h"

namespace oted {

struct Expression::Parser {
  mu::Parser mu;
};

namespace {

// '=' assigns in muParser, which no reward wants and a mistyped == would do.
bool HasAssignment(const std::string& text) {
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '=') continue;
    const char before = i > 0 ? text[i - 1] : ' ';
    if (i + 1 < text.size() && text[i + 1] == '=') {
      ++i;
    } else if (before != '<' && before != '>' && before != '!') {
      return true;
    }
  }
  return false;
}

}  // namespace

Expression::Expression(const std::string& text, const std::map<std::string, double*>& variables,
                       const std::string& what)
    : parser_(std::make_unique<Parser>()), text_(text) {
  const auto fail = [&](const std::string& why) { throw UsageError(fmt::format("{} \"{}\": {}", what, text, why)); };
  std::vector<std::string> names;
  for (const auto& [name, unused] : variables) names.push_back(name);
  if (HasAssignment(text)) fail("'=' assigns; compare with ==");
  try {
    // Brackets belong to names: ee[2] is one number.
    parser_->mu.DefineNameChars("0123456789_abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ[]");
    for (const auto& [name, value] : variables) parser_->mu.DefineVar(name, value);
    parser_->mu.SetExpr(text);
    int n_results = 0;
    parser_->mu.Eval(n_results);
    if (n_results != 1) fail("several values, separated by commas; wanted one number");
  } catch (const mu::ParserError& e) {
    if (e.GetCode() == mu::ecUNASSIGNABLE_TOKEN) {
      fail(fmt::format("unknown name '{}'{}; the names are {}", e.GetToken(), DidYouMean(e.GetToken(), names),
                       fmt::join(names, ", ")));
    }
    fail(fmt::format("{} (at character {})", e.GetMsg(), e.GetPos() + 1));
  }
}

Expression::~Expression() = default;
Expression::Expression(Expression&&) noexcept = default;
Expression& Expression::operator=(Expression&&) noexcept = default;

double Expression::Evaluate() const { return parser_->mu.Eval(); }

bool Expression::IsReserved(const std::string& name) {
  const mu::Parser parser;
  return parser.GetFunDef().contains(name) || parser.GetConst().contains(name);
}

}  // namespace oted
