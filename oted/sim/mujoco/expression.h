#pragma once
/// A small arithmetic expression over named numbers, such as a task's reward: muParser's syntax.

#include <map>
#include <memory>
#include <string>

namespace oted {

/// Reads its variables through pointers each time it is evaluated. One object must not be evaluated by two threads.
class Expression {
 public:
  /// @param text "d_x - 0.1 * sum2_action"; && || ! < > == and a ? b : c as in C, ^ is the power
  /// @param variables name -> where its value stands, as long as this object lives. A name may end in "[i]".
  /// @param what begins every error: "task.reward"
  /// @throws UsageError with the place in the text; for an unknown name with the nearest one and the list.
  Expression(const std::string& text, const std::map<std::string, double*>& variables, const std::string& what);
  ~Expression();
  Expression(Expression&&) noexcept;
  Expression& operator=(Expression&&) noexcept;

  /// NaN or infinite where the arithmetic is: division by zero, the logarithm of a negative number.
  double Evaluate() const;
  const std::string& text() const { return text_; }

  /// Names that no variable may have: functions and constants.
  static bool IsReserved(const std::string& name);

 private:
  struct Parser;
  std::unique_ptr<Parser> parser_;
  std::string text_;
};

}  // namespace oted
