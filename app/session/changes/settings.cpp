#include "app/session/changes/settings.h"

#include <algorithm>
#include <filesystem>

#include "app/session/files.h"

namespace ressort::session {

std::vector<ParameterSetting> changed_settings(const std::vector<ParameterInfo>& parameters,
                                               const Preset& preset,
                                               std::span<const double> values) {
  constexpr double most = 1e12;  // that a preset may say
  std::vector<ParameterSetting> changed;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const ParameterInfo& info = parameters[i];
    const bool is_in_preset =
        std::any_of(preset.parameters.begin(), preset.parameters.end(),
                    [&](const ParameterSetting& setting) { return setting.name == info.name; });
    if (info.audio_input == 0 && (is_in_preset || values[i] != info.value)) {
      changed.push_back(
          {info.name, values[i], std::max(info.minimum, -most), std::min(info.maximum, most)});
    }
  }
  return changed;
}

std::string model_name_elsewhere(const std::string& model_path) {
  const std::filesystem::path path(model_path);
  std::error_code error;
  const std::string known = session::model_path(path.stem().string());
  const bool is_known = !known.empty() && std::filesystem::equivalent(known, path, error);
  return is_known ? path.filename().string()
                  : std::filesystem::absolute(path, error).lexically_normal().string();
}

}  // namespace ressort::session
