// core/kernels: the table of all kernels, with a row for each. The planner, the estimates, explain,
// --method and the benchmark read the rows.
//
// A kernel is a folder: its tables, the function that makes them from a Program, and their cost
// (*_form), the class that steps them, and its loops (*_step).
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

// The kernels that a user can select by name.
enum class Method { direct, chains, modal, grid, batch, oversampled };

// The arguments of the search for a kernel's tables.
struct KernelRequest {
  const Program& program;
  const Workload& load;
  const model::Budget& budget;
  const Progress& progress;
};

struct KernelRow {
  Form::Kind kind;  // type of its tables
  Method method;
  std::string_view name;
  // Makes the tables of a Program; empty if the kernel cannot play it. [any thread but audio]
  std::optional<Form> (*fits)(const KernelRequest&);
  // Returns a lower bound of the operations, if fits() takes long; else null.
  double (*least_operations)(const Program&, const Workload&);
  // The following need a Program in the row's form.
  double (*operations)(const Program&, const Workload&);
  std::string (*description)(const Program&);
  std::uint64_t (*voice_bytes)(const Program&, std::uint64_t number_bytes);
  std::unique_ptr<Kernel<float>> (*make_float)(const Program&, std::size_t voices, Isa);
  std::unique_ptr<Kernel<double>> (*make_double)(const Program&, std::size_t voices, Isa);
};

const KernelRow& row_of(const Form& form);
const KernelRow& row_of(Method method);
std::string_view method_name(Method method);
// Returns nothing if no method has that name.
std::optional<Method> method_named(std::string_view name);

// Returns every method, the reference first.
std::vector<Method> all_methods();
// Returns the same without `oversampled`, which approximates the continuous network better; the
// others compute the published scheme, possibly in other coordinates.
std::vector<Method> published_methods();

// Returns the operations per sample of all voices in the Program's form, with all contacts closed
// all the time: the worst case for a block's deadline.
double operations(const Program& program, const Workload& load);

// The same in ns, at nominal_ns each: a rough guide.
double estimated_ns(const Program& program, const Workload& load);

// Describes the form of this Program in words.
std::string description(const Program& program);

// Returns the memory of one voice in this form, in bytes.
std::uint64_t voice_bytes(const Program& program, std::uint64_t number_bytes);

}  // namespace ressort::kernels
