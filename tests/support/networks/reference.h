// tests: a slow reference simulator with one object per element, against which every kernel is
// tested. It is written from the published formulas, independently of the engine.
// reference_network.h builds one from a Network.
//
// Positions are stored as x[n] and x[n-1], as published. That form loses a factor u/theta of
// precision for slow modes, so it uses the widest floating-point type.
#pragma once

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <span>
#include <vector>

namespace ressort::reference {

using Real = long double;
// A pointer into the simulator, so that a parameter can change the number.
using Number = const Real*;

inline Real sgn(Real x) {
  return x > 0 ? 1 : x < 0 ? -1 : 0;
}

// --- elements with a position ------------------------------------------------------------------

class Point {
 public:
  Point(Real x, Real x_before) : x_(x), x_before_(x_before) {}
  virtual ~Point() = default;
  Point(const Point&) = delete;
  Point& operator=(const Point&) = delete;

  virtual void step() = 0;
  void receive(Real force) { force_ += force; }
  // A force input's value acts during the whole tick, although it moves the mass immediately.
  virtual void push(Real force) {
    receive(force);
    pushed_ += force;
  }
  void begin_tick() { pushed_ = 0; }
  Real position() const { return x_; }
  Real velocity() const { return x_ - x_before_; }
  // Returns the forces of links since the last step and of inputs in this tick.
  virtual Real felt() const { return force_ + pushed_; }

 protected:
  void move_to(Real x) {
    x_before_ = x_;
    x_ = x;
    force_ = 0;
  }
  Real x_;
  Real x_before_;
  Real force_ = 0;
  Real pushed_ = 0;
};

// X[n] = 2 X[n-1] - X[n-2] + F/M
class MassPoint : public Point {
 public:
  MassPoint(Number m, Real x0, Real x1) : Point(x0, x1), m_(m) {}
  void step() override { move_to(2 * x_ - x_before_ + force_ / *m_); }

 private:
  Number m_;
};

// X[n] = (2 - (K+Z)/M) X[n-1] + (Z/M - 1) X[n-2] + F/M
class Oscillator : public Point {
 public:
  Oscillator(Number m, Number k, Number z, Real x0, Real x1) : Point(x0, x1), m_(m), k_(k), z_(z) {}
  void step() override {
    move_to((2 - (*k_ + *z_) / *m_) * x_ + (*z_ / *m_ - 1) * x_before_ + force_ / *m_);
  }

 private:
  Number m_;
  Number k_;
  Number z_;
};

// X[n+1] = 2 r cos w X[n] - r^2 X[n-1] + F/M, with w and r from a frequency and a T60.
class Resonator : public Point {
 public:
  Resonator(Number m, Number frequency_hz, Number t60_s)
      : Point(0, 0), m_(m), frequency_hz_(frequency_hz), t60_s_(t60_s) {}
  void step() override {
    const Real r = std::pow(Real{10}, -3 / (44100 * *t60_s_));
    const Real w = 2 * std::acos(Real{-1}) * *frequency_hz_ / 44100;
    move_to(2 * r * std::cos(w) * x_ - r * r * x_before_ + force_ / *m_);
  }

 private:
  Number m_;
  Number frequency_hz_;
  Number t60_s_;
};

// X[n] = x0
class Ground : public Point {
 public:
  explicit Ground(Real x0) : Point(x0, x0) {}
  void step() override { move_to(x_); }
};

// X[n] = in[n]
class PositionInput : public Point {
 public:
  explicit PositionInput(Real x0) : Point(x0, x0), in_(x0) {}
  void feed(Real in) { in_ = in; }
  void step() override { move_to(in_); }

 private:
  Real in_;
};

// A massless place on rows * columns nodes. Along each side node i has the weight w_i = max(0, 1 -
// |p - i|), with p the coordinate in nodes: X = sum w_i x_i, F_i += w_i F.
class MacroPoint : public Point {
 public:
  // For a body: `rows` places, with a displacement per mode at each place; [place][mode].
  MacroPoint(std::vector<Point*> nodes, std::size_t rows, std::size_t columns, Number u, Number v,
             std::vector<Real> shapes = {})
      : Point(0, 0),
        nodes_(std::move(nodes)),
        rows_(rows),
        columns_(columns),
        u_(u),
        v_(v),
        shapes_(std::move(shapes)) {
    x_ = x_before_ = sum([](const Point& node) { return node.position(); });
  }
  void step() override {
    move_to(sum([](const Point& node) { return node.position(); }));
  }
  void push(Real force) override {
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      nodes_[i]->push(weight(i) * force);
    }
  }
  Real felt() const override {
    return sum([](const Point& node) { return node.felt(); });
  }
  void spread() {
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      nodes_[i]->receive(weight(i) * force_);
    }
    force_ = 0;
  }

 private:
  static Real hat(Real coordinate, std::size_t nodes, std::size_t i) {
    const Real p = std::clamp<Real>(coordinate, 0, 1) * static_cast<Real>(nodes - 1);
    return std::max<Real>(0, 1 - std::fabs(p - static_cast<Real>(i)));
  }
  Real weight(std::size_t i) const {
    if (!shapes_.empty()) {
      Real sum = 0;
      for (std::size_t place = 0; place < rows_; ++place) {
        sum += hat(*u_, rows_, place) * shapes_[place * nodes_.size() + i];
      }
      return sum;
    }
    return hat(*u_, rows_, i / columns_) * hat(*v_, columns_, i % columns_);
  }
  template <class Of>
  Real sum(Of&& of) const {
    Real total = 0;
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      total += weight(i) * of(*nodes_[i]);
    }
    return total;
  }
  std::vector<Point*> nodes_;
  std::size_t rows_;
  std::size_t columns_;
  Number u_;
  Number v_;
  std::vector<Real> shapes_;
};

// --- elements that exert a force: F_a -= f, F_b += f --------------------------------------------

class Interaction {
 public:
  Interaction(Point& a, Point& b) : a_(a), b_(b) {}
  virtual ~Interaction() = default;
  Interaction(const Interaction&) = delete;
  Interaction& operator=(const Interaction&) = delete;

  void step() {
    const Real f = force(a_.position() - b_.position(), a_.velocity() - b_.velocity());
    a_.receive(-f);
    b_.receive(f);
  }

 protected:
  virtual Real force(Real delta, Real nu) const = 0;

 private:
  Point& a_;
  Point& b_;
};

class SpringDamper : public Interaction {
 public:
  SpringDamper(Point& a, Point& b, Number k, Number z) : Interaction(a, b), k_(k), z_(z) {}

 private:
  Real force(Real delta, Real nu) const override { return *k_ * delta + *z_ * nu; }
  Number k_;
  Number z_;
};

// f = K d + Q sgn(d) d^2 + Z v, or with d^3.
class NonlinearSpring : public Interaction {
 public:
  NonlinearSpring(Point& a, Point& b, Number k, Number q, Number z, bool cubic)
      : Interaction(a, b), k_(k), q_(q), z_(z), cubic_(cubic) {}

 private:
  Real force(Real delta, Real nu) const override {
    const Real bent = cubic_ ? delta * delta * delta : sgn(delta) * delta * delta;
    return *k_ * delta + *q_ * bent + *z_ * nu;
  }
  Number k_;
  Number q_;
  Number z_;
  bool cubic_;
};

class ClippedSpring : public Interaction {
 public:
  ClippedSpring(Point& a, Point& b, Number s, Number c, Number k, Number z)
      : Interaction(a, b), s_(s), c_(c), k_(k), z_(z) {}

 private:
  Real force(Real delta, Real nu) const override {
    if (*c_ == 0) {
      return *s_ * delta + *z_ * nu;
    }
    if (*s_ >= *k_) {
      return *k_ * delta + *z_ * nu;
    }
    const Real b = std::sqrt((*k_ - *s_) / *c_);
    return std::fabs(delta) <= b ? *s_ * delta + *c_ * delta * delta * delta + *z_ * nu
                                 : *k_ * delta + (*z_ + 0.3L * *k_) * nu;
  }
  Number s_;
  Number c_;
  Number k_;
  Number z_;
};

class ClippedContact : public Interaction {
 public:
  ClippedContact(Point& a, Point& b, Number s, Number c, Number k, Number z, Number threshold)
      : Interaction(a, b), s_(s), c_(c), k_(k), z_(z), threshold_(threshold) {}

 private:
  Real force(Real delta, Real nu) const override {
    if (!(delta > -*threshold_)) {
      return 0;
    }
    const Real depth = delta + *threshold_;
    const Real k = *k_ < *s_ ? *s_ : *k_;
    const Real c = *k_ < *s_ ? 0 : *c_;
    if (c == 0) {
      return *s_ * depth + *z_ * nu;
    }
    if (*s_ >= k) {
      return k * depth + *z_ * nu;
    }
    const Real b = std::sqrt((k - *s_) / c);
    return (std::fabs(depth) <= b ? *s_ * depth + c * depth * depth * depth : k * depth) + *z_ * nu;
  }
  Number s_;
  Number c_;
  Number k_;
  Number z_;
  Number threshold_;
};

class PowerContact : public Interaction {
 public:
  PowerContact(Point& a, Point& b, Number k, Number p, Number z, Number threshold)
      : Interaction(a, b), k_(k), p_(p), z_(z), threshold_(threshold) {}

 private:
  Real force(Real delta, Real nu) const override {
    const Real depth = delta + *threshold_;
    return depth > 0 ? (*k_ + *z_ * nu) * std::pow(depth, *p_) : 0;
  }
  Number k_;
  Number p_;
  Number z_;
  Number threshold_;
};

class Pluck : public Interaction {
 public:
  Pluck(Point& a, Point& b, Number k, Number s, Number z)
      : Interaction(a, b), k_(k), s_(s), z_(z) {}

 private:
  Real force(Real delta, Real nu) const override {
    const Real k = *k_;
    const Real s = *s_;
    if (std::fabs(delta) < s / 10) {
      return -(k - k / 10) * delta + *z_ * nu;
    }
    if (std::fabs(delta) < s) {
      return -sgn(delta) * (s / 10) * k + (k / 10) * delta + *z_ * nu;
    }
    return 0;
  }
  Number k_;
  Number s_;
  Number z_;
};

class Bow : public Interaction {
 public:
  Bow(Point& a, Point& b, Number z, Number s) : Interaction(a, b), z_(z), s_(s) {}

 private:
  Real force(Real, Real nu) const override {
    const Real z = *z_;
    const Real s = *s_;
    if (std::fabs(nu) < s / 3) {
      return (z - z / 3) * nu;
    }
    if (std::fabs(nu) < s) {
      return sgn(nu) * (s / 3) * z - (z / 3) * nu;
    }
    return 0;
  }
  Number z_;
  Number s_;
};

class SmoothBow : public Interaction {
 public:
  SmoothBow(Point& a, Point& b, Number z, Number s) : Interaction(a, b), z_(z), s_(s) {}

 private:
  Real force(Real, Real nu) const override {
    const Real ratio = nu / *s_;
    return 0.63L * *z_ * nu * std::exp(-4 * ratio * ratio + 0.5L);
  }
  Number z_;
  Number s_;
};

// One of two profiles, selected in every tick.
class EitherBow : public Interaction {
 public:
  EitherBow(Point& a, Point& b, Number z, Number s, Number profile)
      : Interaction(a, b), z_(z), s_(s), profile_(profile) {}

 private:
  Real force(Real, Real nu) const override {
    const Real fast = std::fabs(nu);
    if (*profile_ > 0) {
      return 0.63L * *z_ * nu * std::exp(0.5L - 4 * (nu / *s_) * (nu / *s_));
    }
    return fast < *s_ / 3 ? 2 * *z_ * nu / 3 : fast < *s_ ? sgn(nu) * *z_ * (*s_ - fast) / 3 : 0;
  }
  Number z_;
  Number s_;
  Number profile_;
};

class Contact : public Interaction {
 public:
  Contact(Point& a, Point& b, Number k, Number z, Number threshold)
      : Interaction(a, b), k_(k), z_(z), threshold_(threshold) {}

 private:
  Real force(Real delta, Real nu) const override {
    return delta > -*threshold_ ? *k_ * (delta + *threshold_) + *z_ * nu : 0;
  }
  Number k_;
  Number z_;
  Number threshold_;
};

// --- the simulator -------------------------------------------------------------------------------

class Simulator {
 public:
  // Adds a number for the elements, which may be changed later.
  Real& number(Real value) { return numbers_.emplace_back(value); }

  Point& add_mass(Number m, Real x0, Real x1) { return add_point<MassPoint>(m, x0, x1); }
  Point& add_oscillator(Number m, Number k, Number z, Real x0, Real x1) {
    return add_point<Oscillator>(m, k, z, x0, x1);
  }
  Point& add_ground(Real x0) { return add_point<Ground>(x0); }
  PositionInput& add_position_point(Real x0) {
    auto& point = static_cast<PositionInput&>(add_point<PositionInput>(x0));
    position_points_.push_back(&point);
    points_in_order_.pop_back();
    return point;
  }
  Point& add_resonator(Number m, Number frequency_hz, Number t60_s) {
    return add_point<Resonator>(m, frequency_hz, t60_s);
  }
  Point& add_macro_point(std::vector<Point*> nodes, std::size_t rows, std::size_t columns, Number u,
                         Number v, std::vector<Real> shapes = {}) {
    auto point =
        std::make_unique<MacroPoint>(std::move(nodes), rows, columns, u, v, std::move(shapes));
    macro_points_.push_back(point.get());
    points_.push_back(std::move(point));
    return *points_.back();
  }

  void add_spring(Point& a, Point& b, Number k, Number z) { add<SpringDamper>(a, b, k, z); }
  void add_pluck(Point& a, Point& b, Number k, Number s, Number z) { add<Pluck>(a, b, k, s, z); }
  void add_bow(Point& a, Point& b, Number z, Number s) { add<Bow>(a, b, z, s); }
  void add_smooth_bow(Point& a, Point& b, Number z, Number s) { add<SmoothBow>(a, b, z, s); }
  void add_either_bow(Point& a, Point& b, Number z, Number s, Number profile) {
    add<EitherBow>(a, b, z, s, profile);
  }
  void add_contact(Point& a, Point& b, Number k, Number z, Number threshold) {
    add<Contact>(a, b, k, z, threshold);
  }
  void add_nonlinear_spring(Point& a, Point& b, Number k, Number q, Number z, bool cubic) {
    add<NonlinearSpring>(a, b, k, q, z, cubic);
  }
  void add_clipped_spring(Point& a, Point& b, Number s, Number c, Number k, Number z) {
    add<ClippedSpring>(a, b, s, c, k, z);
  }
  void add_clipped_contact(Point& a, Point& b, Number s, Number c, Number k, Number z,
                           Number threshold) {
    add<ClippedContact>(a, b, s, c, k, z, threshold);
  }
  void add_power_contact(Point& a, Point& b, Number k, Number p, Number z, Number threshold) {
    add<PowerContact>(a, b, k, p, z, threshold);
  }

  // Adds a force of -g / divisor in every tick.
  void add_gravity(Point& point, Number g, Real divisor) {
    weights_.push_back({&point, g, divisor});
  }

  // Inputs are numbered in order of addition, forces and positions together; so are outputs.
  void add_force_input(Point& point) { inputs_.push_back({&point, nullptr}); }
  void add_position_input(PositionInput& point) { inputs_.push_back({nullptr, &point}); }
  void add_output(const Point* point, bool is_force = false) {  // Null: always 0.
    outputs_.push_back({point, is_force});
  }

  std::size_t input_count() const { return inputs_.size(); }
  std::size_t output_count() const { return outputs_.size(); }

  // One tick with the paper's timing: a force input acts on the position of the same tick, and a
  // place on a macro uses its coordinates of this tick. Then masses, position inputs, places and
  // links step; an output reads the new state.
  std::vector<double> step(std::span<const double> inputs) {
    for (const auto& point : points_) {
      point->begin_tick();
    }
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      if (inputs_[i].pushed != nullptr) {
        inputs_[i].pushed->push(inputs[i]);
      } else {
        inputs_[i].moved->feed(inputs[i]);
      }
    }
    for (const Weight& weight : weights_) {
      weight.point->receive(-*weight.g / weight.divisor);
    }
    for (Point* const point : points_in_order_) {
      point->step();
    }
    for (PositionInput* const point : position_points_) {
      point->step();
    }
    for (MacroPoint* const point : macro_points_) {
      point->step();
    }
    for (const auto& link : links_) {
      link->step();
    }
    for (MacroPoint* const point : macro_points_) {
      point->spread();
    }
    std::vector<double> outputs;
    outputs.reserve(outputs_.size());
    for (const Output& output : outputs_) {
      const Real value = output.point == nullptr ? 0
                         : output.is_force       ? output.point->felt()
                                                 : output.point->position();
      outputs.push_back(static_cast<double>(value));
    }
    return outputs;
  }

 private:
  struct Weight {
    Point* point = nullptr;
    Number g = nullptr;
    Real divisor = 1;
  };
  struct Output {
    const Point* point = nullptr;
    bool is_force = false;
  };
  struct Input {
    Point* pushed = nullptr;
    PositionInput* moved = nullptr;
  };

  template <class T, class... Arguments>
  Point& add_point(Arguments... arguments) {
    points_.push_back(std::make_unique<T>(arguments...));
    points_in_order_.push_back(points_.back().get());
    return *points_.back();
  }
  template <class T, class... Arguments>
  void add(Point& a, Point& b, Arguments... arguments) {
    links_.push_back(std::make_unique<T>(a, b, arguments...));
  }

  std::deque<Real> numbers_;
  std::vector<std::unique_ptr<Point>> points_;
  std::vector<Point*> points_in_order_;  // Masses, oscillators, grounds.
  std::vector<PositionInput*> position_points_;
  std::vector<MacroPoint*> macro_points_;
  std::vector<std::unique_ptr<Interaction>> links_;
  std::vector<Input> inputs_;
  std::vector<Weight> weights_;
  std::vector<Output> outputs_;
};

}  // namespace ressort::reference
