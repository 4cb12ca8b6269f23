#include "app/commands/make.h"
#include "app/commands/output.h"

#include <cstdio>

#include "app/exit_code.h"
#include "app/session/files.h"
#include "app/text.h"
#include "core/analysis/stability.h"
#include "core/model/language/mdl.h"
#include "core/model/language/print.h"

namespace ressort::commands {
namespace {

// Warns about an unstable model but writes it: its numbers can be edited.
void warn_if_unstable(const Network& network) {
  const std::vector<double> values = parameter_values(network);
  const Certificate found = Stability(network, 1.0).certify({values, values});
  if (found.verdict == Verdict::unstable) {
    std::fprintf(stderr, "warning: %s\n", complaint(found).message.c_str());
  }
}

}  // namespace

int make(const MakeOptions& options) {
  const auto network = generate(options.shape);
  if (!network) {
    return reject(network.error().message);
  }
  const std::string text = print_network(*network);
  if (text.size() > max_model_bytes) {
    return reject("the model would exceed the largest size that can be read, " +
                  std::to_string(max_model_bytes >> 20) + " MiB; use a shorter --name");
  }
  warn_if_unstable(*network);
  if (options.output.empty()) {
    std::fwrite(text.data(), 1, text.size(), stdout);
    return exit_code::done;
  }
  if (const int failure = write_output(options.output, text, options.force)) {
    return failure;
  }
  std::printf("%s: %s, %s\n", options.output.c_str(),
              options.shape.as_macro ? "one macro"
                                     : counted(network->masses.size(), "mass", "masses").c_str(),
              counted(network->links.size(), "link", "links").c_str());
  return exit_code::done;
}

}  // namespace ressort::commands
