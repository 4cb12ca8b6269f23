#include "core/compile/cull.h"

namespace ressort::compile {
namespace {

class Culler {
 public:
  Culler(const Network& network, const Progress& progress)
      : network_(network),
        progress_(progress),
        groups_(network.masses.size()),
        is_heard_(network.masses.size()),
        is_listened_(network.masses.size()) {}

  Culled cull() {
    for (const Link& link : network_.links) {
      culled_.is_slack.push_back(is_idle(link));
      const bool is_tied =
          link.a != link.b && (moves(network_.masses[link.a]) || moves(network_.masses[link.b]));
      culled_.idle += culled_.is_slack.back() && is_tied ? 1 : 0;
    }
    join_groups();
    mark_heard();
    mark_dead();
    return std::move(culled_);
  }

 private:
  bool is_zero(ArgumentId argument) const {
    return argument == no_argument || (is_constant(network_.arguments[argument]) &&
                                       evaluate(network_.arguments[argument], {}) == 0.0);
  }

  bool is_idle(const Link& link) const {
    const LawFacts& law = facts_of(link.law);
    for (std::size_t i = 0; i < law.count; ++i) {
      if (law.is_strength(i) && !is_zero(link.arguments[i])) {
        return false;
      }
    }
    return true;
  }

  bool carries(std::uint32_t mass) const {
    const MassKind kind = network_.masses[mass].kind;
    return moves(network_.masses[mass]) || kind == MassKind::point || kind == MassKind::junction;
  }

  void join_groups() {
    each_live_link([&](const Link& link) {
      if (carries(link.a) && carries(link.b)) {
        groups_.join(link.a, link.b);
      }
    });
    join_places(
        network_, groups_, progress_, [](std::uint32_t) { return true; }, [](std::uint32_t) {});
  }

  // Marks the groups that outputs hear. A force output at a ground or a position input hears the
  // groups at the other ends of its links.
  void mark_heard() {
    std::vector<bool> hears_links(network_.masses.size());
    for (const Output& output : network_.outputs) {
      is_listened_[output.mass] = true;
      hears_links[output.mass] =
          hears_links[output.mass] || (output.is_force && !carries(output.mass));
      mark(is_heard_, output.mass);
    }
    each_live_link([&](const Link& link) {
      for (const auto& [end, other] : {std::pair(link.a, link.b), std::pair(link.b, link.a)}) {
        if (hears_links[end]) {
          mark(is_heard_, other);
        }
      }
    });
  }

  void mark_dead() {
    culled_.is_dead.assign(network_.masses.size(), true);
    for (std::uint32_t i = 0; i < network_.masses.size(); ++i) {
      if (!carries(i)) {
        culled_.is_dead[i] = !is_listened_[i];
        continue;
      }
      culled_.is_dead[i] = !is_heard_[groups_.find(i)];
      culled_.unheard += culled_.is_dead[i] && moves(network_.masses[i]) ? 1 : 0;
    }
    for (std::size_t l = 0; l < network_.links.size(); ++l) {
      const Link& link = network_.links[l];
      const bool a_dead = carries(link.a) && culled_.is_dead[link.a];
      const bool b_dead = carries(link.b) && culled_.is_dead[link.b];
      if (a_dead || b_dead) {
        culled_.is_slack[l] = true;
      }
      if (!culled_.is_slack[l]) {
        culled_.is_dead[link.a] = false;
        culled_.is_dead[link.b] = false;
      }
    }
  }

  template <class Use>
  void each_live_link(Use&& use) {
    progress_.spend(2 * network_.links.size());
    for (std::size_t l = 0; l < network_.links.size(); ++l) {
      if (!culled_.is_slack[l]) {
        use(network_.links[l]);
      }
    }
  }

  void mark(std::vector<bool>& marks, std::uint32_t mass) { marks[groups_.find(mass)] = true; }

  const Network& network_;
  const Progress& progress_;
  Groups groups_;
  Culled culled_;
  std::vector<bool> is_heard_;     // [group]
  std::vector<bool> is_listened_;  // [mass] has an output
};

std::string masses(std::size_t count) {
  return std::to_string(count) + (count == 1 ? " mass" : " masses");
}

}  // namespace

Culled cull(const Network& network, const Progress& progress) {
  return Culler(network, progress).cull();
}

std::string describe(const Culled& culled) {
  std::string text;
  const auto add = [&](std::size_t count, const std::string& what) {
    if (count > 0) {
      text += (text.empty() ? "" : ", ") + what;
    }
  };
  add(culled.unheard, masses(culled.unheard) + " that no output hears");
  add(culled.idle,
      std::to_string(culled.idle) + (culled.idle == 1 ? " link" : " links") + " without strength");
  return text;
}

}  // namespace ressort::compile
