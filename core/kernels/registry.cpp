#include "core/kernels/registry.h"

#include <algorithm>
#include <iterator>
#include <type_traits>
#include <utility>

#include "core/kernels/batch/batch.h"
#include "core/kernels/batch/batch_form.h"
#include "core/kernels/chains/chains.h"
#include "core/kernels/chains/chains_form.h"
#include "core/kernels/direct/direct.h"
#include "core/kernels/direct/direct_form.h"
#include "core/kernels/grid/grid.h"
#include "core/kernels/grid/grid_form.h"
#include "core/kernels/modal/modal.h"
#include "core/kernels/modal/modal_form.h"
#include "core/kernels/oversampled/oversampled.h"
#include "core/kernels/oversampled/oversampled_form.h"

namespace ressort::kernels {
namespace {

using Request = KernelRequest;

template <class T, class Tables, template <class> class K>
std::unique_ptr<Kernel<T>> make(const Program& program, std::size_t voices, Isa isa) {
  return std::make_unique<K<T>>(program, program.form.get<Tables>(), voices, isa);
}

// Returns the row of kernel K. `Fits` makes its tables.
template <class Tables, template <class> class K, class Fits>
constexpr KernelRow row(Method method, std::string_view name, Fits,
                        double (*least_operations)(const Program&, const Workload&) = nullptr) {
  return {
      .kind = Form::kind_of<Tables>(),
      .method = method,
      .name = name,
      .fits = [](const Request& request) -> std::optional<Form> {
        if (!request.program.waveguides.empty() && !std::is_same_v<Tables, Direct>) {
          return std::nullopt;  // Only the direct kernel has waveguides.
        }
        std::optional<Tables> tables = Fits()(request);
        return tables ? std::optional<Form>(std::move(*tables)) : std::nullopt;
      },
      .least_operations = least_operations,
      .operations =
          [](const Program& program, const Workload& load) {
            return operations(program, program.form.get<Tables>(), load);
          },
      .description =
          [](const Program& program) { return description(program, program.form.get<Tables>()); },
      .voice_bytes =
          [](const Program& program, std::uint64_t number_bytes) {
            return voice_bytes(program, program.form.get<Tables>(), number_bytes);
          },
      .make_float = make<float, Tables, K>,
      .make_double = make<double, Tables, K>};
}

constexpr KernelRow rows[] = {
    row<Chains, ChainsKernel>(Method::chains, "chains",
                              [](const Request& r) { return chains_form(r.program, r.progress); }),
    row<Grid, GridKernel>(Method::grid, "grid",
                          [](const Request& r) { return grid_form(r.program, r.progress); }),
    row<Batch, BatchKernel>(Method::batch, "batch",
                            [](const Request& r) { return batch_form(r.program); }),
    row<Modes, ModalKernel>(
        Method::modal, "modal",
        [](const Request& r) {
          return modal_form(r.program, r.budget, r.progress, r.load.is_untuned,
                            r.load.reaches_beyond());
        },
        least_modal_operations),
    row<Oversampled, OversampledKernel>(
        Method::oversampled, "oversampled",
        [](const Request& r) {
          constexpr std::uint32_t times = 4;  // steps per sample of --method oversampled
          return r.program.moving > 0 && r.program.modes.empty()
                     ? std::optional(oversampled_form(oversampled_program(r.program, times), times))
                     : std::nullopt;
        }),
    row<Direct, DirectKernel>(Method::direct, "direct", [](const Request&) { return Direct(); }),
};

}  // namespace

const KernelRow& row_of(const Form& form) {
  return *std::find_if(std::begin(rows), std::end(rows),
                       [&](const KernelRow& row) { return row.kind == form.kind(); });
}

const KernelRow& row_of(Method method) {
  return *std::find_if(std::begin(rows), std::end(rows),
                       [&](const KernelRow& row) { return row.method == method; });
}

std::string_view method_name(Method method) {
  return row_of(method).name;
}

std::optional<Method> method_named(std::string_view name) {
  const auto row = std::find_if(std::begin(rows), std::end(rows),
                                [&](const KernelRow& row) { return row.name == name; });
  return row == std::end(rows) ? std::nullopt : std::optional(row->method);
}

std::vector<Method> all_methods() {
  std::vector<Method> methods = {Method::direct};
  for (const KernelRow& row : rows) {
    if (row.method != Method::direct) {
      methods.push_back(row.method);
    }
  }
  return methods;
}

std::vector<Method> published_methods() {
  std::vector<Method> methods = all_methods();
  std::erase(methods, Method::oversampled);
  return methods;
}

double operations(const Program& program, const Workload& load) {
  return row_of(program.form).operations(program, load);
}

double estimated_ns(const Program& program, const Workload& load) {
  return nominal_ns * operations(program, load);
}

std::string description(const Program& program) {
  return row_of(program.form).description(program);
}

std::uint64_t voice_bytes(const Program& program, std::uint64_t number_bytes) {
  return row_of(program.form).voice_bytes(program, number_bytes);
}

template <class T>
std::unique_ptr<Kernel<T>> make_kernel(const Program& program, std::size_t voices, Isa isa) {
  const KernelRow& row = row_of(program.form);
  if constexpr (std::is_same_v<T, float>) {
    return row.make_float(program, voices, isa);
  } else {
    return row.make_double(program, voices, isa);
  }
}
template std::unique_ptr<Kernel<float>> make_kernel(const Program&, std::size_t, Isa);
template std::unique_ptr<Kernel<double>> make_kernel(const Program&, std::size_t, Isa);

}  // namespace ressort::kernels
