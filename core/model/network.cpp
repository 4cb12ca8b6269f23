#include "core/model/network.h"

#include <algorithm>

namespace ressort {

double argument_value(const Network& network, ArgumentId argument,
                      std::span<const double> parameters) {
  return argument == no_argument ? 0.0 : evaluate(network.arguments[argument], parameters);
}

LinearPart linear_part(const Link& link) {
  switch (link.kind) {
    case LinkKind::spring:
      return {link.arguments[0], link.arguments[1]};
    case LinkKind::quadratic_spring:
    case LinkKind::cubic_spring:
      return {link.arguments[0], link.arguments[2]};
    case LinkKind::clipped_spring:
      return {link.arguments[0], link.arguments[3]};
    default:
      return {};
  }
}

std::vector<double> parameter_values(const Network& network) {
  std::vector<double> values;
  values.reserve(network.parameters.size());
  for (const Parameter& parameter : network.parameters) {
    values.push_back(parameter.value);
  }
  return values;
}

double initial_velocity(const Network& network, const Mass& mass) {
  if (mass.kind == MassKind::ground || mass.kind == MassKind::position) {
    return 0.0;
  }
  return network.third == ThirdArgument::delayed_position ? mass.position - mass.third
                                                          : mass.third / Network::reference_rate_hz;
}

int input_count(const Network& network) {
  int count = 0;
  for (const Input& input : network.inputs) {
    count = std::max(count, input.number);
  }
  return count;
}

int output_count(const Network& network) {
  int count = 0;
  for (const Output& output : network.outputs) {
    count = std::max(count, output.number);
  }
  return count;
}

}  // namespace ressort
