// core/kernels: the tables that a kernel derives from a Program, for any kernel.
#pragma once

#include <concepts>
#include <memory>

namespace ressort::kernels {

// The tables of one kernel, type-erased. They are immutable, and copies share them. The type of the
// tables names the kernel: registry.cpp has a row for each.
class Form {
 public:
  // The direct form, which every Program has.
  Form();
  template <class Tables>
  requires(!std::same_as<Tables, Form>) Form(Tables tables) : kind_(kind_of<Tables>()) {
    if constexpr (requires { tables.is_exact; }) {
      is_continuous_ = tables.is_exact;
    }
    tables_ = std::make_shared<const Tables>(std::move(tables));
  }
  // No move operations: a Program whose form was moved away still has its tables.
  Form(const Form&) = default;
  Form& operator=(const Form&) = default;
  ~Form() = default;

  // Returns null if the tables belong to another kernel.
  template <class Tables>
  const Tables* get_if() const {
    return is<Tables>() ? static_cast<const Tables*>(tables_.get()) : nullptr;
  }
  template <class Tables>
  const Tables& get() const {
    return *static_cast<const Tables*>(tables_.get());
  }
  template <class Tables>
  bool is() const {
    return kind_ == kind_of<Tables>();
  }

  // An address that is unique to each type of tables.
  using Kind = const void*;
  Kind kind() const { return kind_; }
  template <class Tables>
  static constexpr Kind kind_of() {
    return &tag<Tables>;
  }

  // Returns whether its coefficients are those of the continuous network.
  bool is_continuous() const { return is_continuous_; }

 private:
  template <class>
  static constexpr char tag = 0;

  Kind kind_;
  bool is_continuous_ = false;
  std::shared_ptr<const void> tables_;
};

}  // namespace ressort::kernels
