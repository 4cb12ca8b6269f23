#include "tests/support/networks/random_network.h"

#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include "tests/support/random.h"

namespace ressort::support {
namespace {

class NetworkWriter {
 public:
  explicit NetworkWriter(std::uint64_t seed) : seed_(seed), random_(seed) {}

  RandomNetwork write() {
    static constexpr const char* families[] = {
        "body",       "string",     "stiff", "square", "triangle", "tree", "graph",
        "line macro", "mesh macro", "body",  "string", "square",   "parts"};
    const std::string family = families[seed_ % std::size(families)];
    is_linear_ = chance(2);
    is_alike_ = chance(2);
    has_macro_ = family == "line macro" || family == "mesh macro";
    const bool is_line = family == "string" || family == "stiff" || family == "line macro";
    add("@k param " + number(0.03, is_line ? 0.2 : 0.1) + "\n@z param " + number(0.002, 0.02));
    add("@l param " + number(0.01, 0.03) + "\n@m param " + number(1.0, 2.0) + "\n@u param " +
        number(0.1, 0.9));
    add("@g0 ground 0.\n@g1 ground " + number(-0.05, 0.05));
    alike_mass_ = chance(3) ? "osc m 0.002 0.001 " : "mass m ";
    has_audio_ = !is_alike_ && chance(6);
    if (has_audio_) {
      add("@a audioParam @in9");
    }
    const std::size_t parts = family == "parts" ? 2 + random_.below(4) : 1;
    for (std::size_t part = 0; part < parts; ++part) {
      add_structure(parts == 1 ? family : families[random_.below(std::size(families) - 1)]);
    }
    if (seed_ % 5 == 2) {
      add_modal_body();
    }
    add_hands();
    for (std::size_t i = 0; !is_linear_ && i < 1 + random_.below(4); ++i) {
      add_bent(chance(2) ? "@g0" : chance(2) ? "@g1" : some());
    }
    add_outputs();
    return {family, chance(2) ? shuffled() : joined(), is_linear_, may_drift_};
  }

 private:
  using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;

  bool chance(std::size_t one_in) { return random_.below(one_in) == 0; }
  std::string number(double low, double high) { return show(random_.uniform(low, high)); }
  std::string label() { return "@x" + std::to_string(labels_++); }
  void add(const std::string& lines) { lines_.push_back(lines + "\n"); }

  // Returns a random mass or place on a macro.
  std::string some() { return ends_[random_.below(ends_.size())]; }

  std::string mass() {
    const std::string start = chance(4) ? number(-0.03, 0.03) + " 0." : "0. 0.";
    if (is_alike_) {
      return alike_mass_ + start;
    }
    switch (random_.below(6)) {
      case 1:
        return "mass " + number(1.0, 3.0) + " " + start;
      case 2:
        return "osc m 0.002 0.001 " + start;
      case 3:
        return "osc 1.5 l [0.5 * z] " + start;
      case 4:
        return "mass m " + number(0.0, 0.2) + " " + start;  // with gravity
      default:
        return "mass m " + start;
    }
  }

  std::string spring() {
    switch (is_alike_ ? 0 : random_.below(7)) {
      case 1:
        return "0.5*k z";
      case 2:
        return "[k - 0.3 * l] z";
      case 3:
        return number(0.02, 0.1) + " " + number(0.001, 0.01);
      case 4:
        return "l [z + 0.001]";
      case 5:
        return "sqrt(k*l) 0.3*z";
      default:
        return "k z";
    }
  }

  void add_spring(const std::string& a, const std::string& b, const std::string& numbers) {
    add(label() + " springDamper " + (chance(2) ? a + " " + b : b + " " + a) + " " + numbers);
  }

  void anchor(const std::string& end) { add_spring(end, "@g0", "k z"); }

  // --- structures ---

  void add_structure(const std::string& family) {
    const bool is_open = chance(3);
    if (family == "string" || family == "stiff") {
      const std::size_t count = 8 + random_.below(60);
      Pairs springs = row(count, 1);
      if (is_open && chance(2)) {
        springs.emplace_back(0, count - 1);  // A ring.
      }
      add_net(count, springs, family == "stiff" ? row(count, 2) : Pairs{}, {0, count - 1}, is_open);
    } else if (family == "square") {
      add_rectangle(4 + random_.below(7), 4 + random_.below(8), is_open);
    } else if (family == "triangle") {
      add_triangle(5 + random_.below(6), is_open);
    } else if (family == "line macro" || family == "mesh macro") {
      add_macro(family == "mesh macro");
    } else {
      const bool is_body = family == "body";
      add_irregular(is_body ? 1 + random_.below(16) : 10 + random_.below(40), family == "graph",
                    is_open);
    }
  }

  static Pairs row(std::size_t count, std::size_t step) {
    Pairs pairs;
    for (std::size_t i = 0; i + step < count; ++i) {
      pairs.emplace_back(i, i + step);
    }
    return pairs;
  }

  void add_rectangle(std::size_t rows, std::size_t columns, bool is_open) {
    Pairs springs;
    for (std::size_t i = 0; i < rows * columns; ++i) {
      if ((i + 1) % columns != 0 && !chance(200)) {
        springs.emplace_back(i, i + 1);
      }
      if (i + columns < rows * columns && !chance(200)) {
        springs.emplace_back(i, i + columns);
      }
    }
    add_net(rows * columns, springs, {}, {0, rows * columns - 1}, is_open);
  }

  void add_triangle(std::size_t side, bool is_open) {
    Pairs springs;
    std::size_t first = 0;  // First node of its row.
    for (std::size_t length = side; length > 1; --length) {
      for (std::size_t i = first; i + 1 < first + length; ++i) {
        springs.insert(springs.end(), {{i, i + 1}, {i, i + length}, {i + 1, i + length}});
      }
      first += length;
    }
    add_net(first + 1, springs, {}, {0}, is_open);
  }

  // A tree and, for a graph or a small body, some additional springs.
  void add_irregular(std::size_t count, bool is_graph, bool is_open) {
    Pairs springs;
    for (std::size_t i = 1; i < count; ++i) {
      springs.emplace_back(i, i - 1 - random_.below(std::min<std::size_t>(i, 4)));
    }
    for (std::size_t i = 0; i < (is_graph ? count / 2 : count < 17 ? count / 3 : 0); ++i) {
      springs.emplace_back(random_.below(count), random_.below(count));
    }
    add_net(count, springs, {}, {}, is_open, !is_alike_ && chance(2));
  }

  // Masses, springs between them and, of another kind, second springs. The masses of `corners` are
  // grounds or attached to one or to a position input, unless the network is open.
  void add_net(std::size_t count, const Pairs& springs, const Pairs& seconds,
               const std::vector<std::size_t>& corners, bool is_open, bool is_mixed = false) {
    const std::string kind = mass();
    const std::string numbers = spring();
    const std::string second = is_alike_ ? "l 0." : number(0.01, 0.05) + " 0.";
    std::vector<std::string> names;
    for (std::size_t i = 0; i < count; ++i) {
      names.push_back(label());
      const bool is_corner = std::find(corners.begin(), corners.end(), i) != corners.end();
      if (is_corner && !is_open && chance(2)) {
        add(names[i] + " ground " + (chance(3) ? number(-0.02, 0.02) : "0."));
        continue;
      }
      add(names[i] + " " + (is_mixed ? mass() : kind));
      ends_.push_back(names[i]);
      if (is_corner && !is_open) {
        add_spring(names[i], hand(), numbers);
      }
    }
    for (const auto& [a, b] : springs) {
      if (a != b) {
        add_spring(names[a], names[b], is_mixed ? spring() : numbers);
      }
    }
    for (const auto& [a, b] : seconds) {
      add_spring(names[a], names[b], second);
    }
    if (!is_linear_ || corners.empty() || chance(2)) {
      anchor(ends_.back());
    } else {
      may_drift_ |= is_open;
    }
  }

  void add_macro(bool is_mesh) {
    static constexpr const char* lines[] = {"string", "chain", "stiffString"};
    static constexpr const char* meshes[] = {"mesh", "closedMesh", "cornerMesh"};
    const std::string keyword = (is_mesh ? meshes : lines)[random_.below(3)];
    const std::string name = label();
    const std::string size =
        is_mesh ? std::to_string(5 + random_.below(6)) + " " + std::to_string(5 + random_.below(6))
                : std::to_string(10 + random_.below(50));
    add(name + " " + keyword + " " + size + " m k " + (keyword == "stiffString" ? "l " : "") +
        "z " + (chance(2) ? "0.0005 " : "") + "0. 0.");
    has_macro_ = true;
    static constexpr const char* places[] = {"u", "0.31", "0.5*u", "1-u", "0.87"};
    for (int i = 0; i < 3; ++i) {
      ends_.push_back("[" + name + " " + places[random_.below(5)] +
                      (is_mesh ? std::string(" ") + places[random_.below(5)] : "") + "]");
    }
    anchor(ends_.back());
  }

  // A body of modes, tied to the existing network, from a separate random sequence.
  void add_modal_body() {
    Random random(seed_ ^ 0x5deece66du);
    const auto any = [&](double low, double high) { return show(random.uniform(low, high)); };
    const std::string name = label();
    const std::size_t places = 1 + random.below(3);
    const std::size_t modes = 1 + random.below(6);
    std::string body = name + " body " + (random.below(3) == 0 ? "m" : any(1.0, 30.0));
    for (std::size_t place = 0; place < places; ++place) {
      body += " p" + std::to_string(place);
    }
    add(body);
    for (std::size_t mode = 0; mode < modes; ++mode) {
      std::string line = label() + " mode " + name + " " + any(40.0, 9000.0) +
                         (random.below(4) == 0 ? "*u " : " ") + any(0.02, 3.0);
      for (std::size_t place = 0; place < places; ++place) {
        line += " " + any(-1.0, 1.0);
      }
      add(line);
    }
    const std::string held = some();
    ends_.push_back("[" + name + " p" + std::to_string(random.below(places)) + "]");
    ends_.push_back("[" + name + " " + (random.below(3) == 0 ? "u" : any(0.0, 1.0)) + "]");
    if (random.below(3) != 0) {
      add_spring(held, ends_.back(), any(0.001, 0.05) + " " + any(0.0, 0.01));
    }
  }

  // --- inputs and outputs ---

  std::string hand() {
    if (driven_ == 3 || chance(2)) {
      return chance(2) ? "@g0" : "@g1";
    }
    const std::string name = "@in" + std::to_string(++driven_);
    add(name + " posInput " + (chance(2) ? "0." : number(-0.02, 0.02)));
    hand_names_.push_back(name);
    return name;
  }

  void add_hands() {
    const std::size_t forces = 1 + random_.below(2);
    for (std::size_t i = 0; i < forces; ++i) {
      add("@in" + std::to_string(++driven_) + " frcInput " + some());
    }
    if (chance(2)) {
      const std::string name = "@in" + std::to_string(++driven_);
      add(name + " posInput " + number(-0.02, 0.02));
      hand_names_.push_back(name);
      if (is_linear_ || chance(2)) {
        add_spring(name, some(), spring());
      } else {
        add_bent(name);
      }
    }
    if (has_audio_) {
      add(label() + " springDamper @g0 " + some() + " " + (chance(2) ? "a z" : "[a + 0.2 * k] z"));
    }
  }

  // Adds a nonlinear link from a random mass to `end`.
  void add_bent(const std::string& end) {
    const std::string mass = some();
    if (mass == end) {
      return;
    }
    anchor(mass);
    static constexpr const char* laws[][2] = {
        {"nlSpring2", "0.01 0.02 0.001"},
        {"nlSpring3", "0.01 0.05 0.002"},
        {"nlSpring3", "l 0.2*l z"},
        {"nlSpringDamper", "0.005 0.001 0.02 0.002"},  // Far from its clipping point.
        {"contact", "0.01 0. 0.002"},
        {"contact", "l 0. 0."},
        {"contact", "0.001 0.003 1."},  // Always in contact.
        {"nlContact", "0.005 0.1 0.02 0. 0.003"},
        {"nlContact", "0.001 0.00001 0.002 0.003 1."},
        {"nlPluck", "0.01 0.02"},
        {"nlPluck", "0.5*l 0.1"},
        {"nlPluck", "0.001 1. 0.002"},  // Never releases.
        {"nlBow", "0.004 0.002"},
        {"nlBow", "z 9."},  // Never slips.
        {"nlBow", "0.004 0.002 1"},
        {"nlSpring2", "0.5*l l z"}};
    const auto& law = laws[random_.below(std::size(laws))];
    const bool is_first = chance(2);
    add(label() + " " + law[0] + " " + (is_first ? mass + " " + end : end + " " + mass) + " " +
        law[1]);
  }

  void add_outputs() {
    const std::size_t count = 1 + random_.below(3);
    for (std::size_t i = 1; i <= count; ++i) {
      const bool is_force = !has_macro_ && !may_drift_ && chance(12);
      const bool is_held = chance(20);
      add("@out" + std::to_string(i) + (is_force ? " frcOutput " : " posOutput ") +
          (!is_held              ? some()
           : hand_names_.empty() ? "@g1"
                                 : hand_names_.back()));
    }
  }

  std::string joined() const {
    std::string text;
    for (const std::string& line : lines_) {
      text += line;
    }
    return text;
  }
  std::string shuffled() {
    for (std::size_t i = lines_.size(); i > 1; --i) {
      std::swap(lines_[i - 1], lines_[random_.below(i)]);
    }
    return joined();
  }

  std::uint64_t seed_;
  Random random_;
  std::vector<std::string> lines_;
  std::vector<std::string> ends_;        // Ends that links may use.
  std::vector<std::string> hand_names_;  // Position inputs.
  std::size_t labels_ = 0;
  std::size_t driven_ = 0;
  bool is_linear_ = true;
  bool is_alike_ = true;  // Equal masses and springs, so that they share eigenvectors.
  std::string alike_mass_;
  bool has_audio_ = false;
  bool may_drift_ = false;
  bool has_macro_ = false;
};

}  // namespace

RandomNetwork random_network(std::uint64_t seed) {
  return NetworkWriter(seed).write();
}

}  // namespace ressort::support
