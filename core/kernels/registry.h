// core/kernels: all kernels, a row each. Whoever plans, predicts, explains, times or names them
// reads the rows.
//
// A kernel is a folder: the tables that it computes from, whether a
// Program has them and what they cost (*_form), the class that steps them, and its loops (*_step).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/kernels/estimates.h"
#include "core/kernels/kernel.h"
#include "core/kernels/program.h"
#include "core/model/preset/budget.h"
#include "core/progress.h"

namespace ressort::kernels {

// By which name a kernel is asked for.
enum class Method { direct, chains, modal, grid, batch, oversampled };

// Whom a kernel is wanted for.
struct KernelRequest {
  const Program& program;
  const Workload& load;
  const model::Budget& budget;
  const Progress& progress;
};

struct KernelRow {
  enum class Use {
    published,  // the published scheme, in other coordinates at most
    physical,   // true to the continuous network instead: where a budget asks for it, or by name
    given,      // comes with several cores, never by its own name
  };

  Form::Kind kind;  // of its tables
  Method method;    // of a given one, what it does
  std::string_view name;
  Use use;
  // The tables of a Program; nothing where the kernel cannot play it. [any thread but audio]
  std::optional<Form> (*fits)(const KernelRequest&);
  // What it costs at least, where fits() takes long; else null.
  double (*least_ns)(const Program&, const Workload&);
  // These ask for a Program in the row's own form. Of what it does, where it is not made of others:
  Work (*work)(const Program&, const Workload&);
  double (*predicted_ns)(const Program&, const Workload&);
  std::string (*description)(const Program&);
  std::uint64_t (*voice_bytes)(const Program&, std::uint64_t number_bytes);
  std::unique_ptr<Kernel<float>> (*make_float)(const Program&, std::size_t voices, Isa);
  std::unique_ptr<Kernel<double>> (*make_double)(const Program&, std::size_t voices, Isa);
};

// The one that all others are compared with, and that plays everything, comes last.
std::span<const KernelRow> kernel_rows();

const KernelRow& row_of(const Form& form);
const KernelRow& row_of(Method method);
std::string_view method_name(Method method);
// Returns nothing if no method has that name.
std::optional<Method> method_called(std::string_view name);
// Returns what to use instead of a method that earlier versions had; empty for any other name.
std::string removed_method_advice(std::string_view name);

// All of one use, the reference first.
std::vector<Method> methods_for(KernelRow::Use use);

// Nanoseconds a sample for all voices in the form that the Program has, everything that can touch
// touching all the time: what a block's budget has to hold. By the prices of the machine's kind
// (prices.h): the same on all machines of one instruction set.
double predicted_ns(const Program& program, const Workload& load);

// What the form is, of this Program, in words.
std::string description(const Program& program);

// One voice in this form, in bytes.
std::uint64_t voice_bytes(const Program& program, std::uint64_t number_bytes);

}  // namespace ressort::kernels
