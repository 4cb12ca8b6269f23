#include "core/kernels/domains/sharded.h"

#include <algorithm>
#include <optional>

#include "core/kernels/domains/sharded_form.h"

namespace ressort::kernels {
namespace {

// Returns the index of a node of the whole in a shard.
std::optional<std::uint32_t> find(const Shard& shard, std::uint32_t node) {
  const auto at = std::lower_bound(shard.nodes.begin(), shard.nodes.end(), node);
  if (at == shard.nodes.end() || *at != node) {
    return std::nullopt;
  }
  return static_cast<std::uint32_t>(at - shard.nodes.begin());
}

// Copies a row, one number per lane, between tables.
template <class T>
void copy_row(const T* from, std::size_t from_row, T* to, std::size_t to_row, std::size_t width) {
  std::copy_n(from + from_row * width, width, to + to_row * width);
}

template <class T>
std::vector<std::unique_ptr<Kernel<T>>> kernels_of(const Shards& form, std::size_t voices,
                                                   Isa isa) {
  std::vector<std::unique_ptr<Kernel<T>>> kernels;
  for (const Shard& shard : *form.shards) {
    kernels.push_back(make_kernel<T>(shard.program, voices, isa));
  }
  return kernels;
}

}  // namespace

template <class T>
ShardedKernel<T>::ShardedKernel(const Program& program, const Shards& form, std::size_t voices,
                                Isa isa)
    : ShardedKernel(program, form, kernels_of<T>(form, voices, isa), voices, isa) {}

template <class T>
ShardedKernel<T>::ShardedKernel(const Program& program, const Shards& form, Kernels kernels,
                                std::size_t voices, Isa isa)
    : Kernel<T>(program, kernels.front()->width()),
      program_(program),
      shards_(*form.shards),
      frames_(form.frames),
      kernels_(std::move(kernels)) {
  place_taps();
  std::vector<Task*> tasks;
  std::size_t most_nodes = 0;
  for (std::size_t i = 0; i < shards_.size(); ++i) {
    typename KernelTask<T>::Make make;
    if (form.executor->is_live()) {
      make = [&, i] { return make_kernel<T>(shards_[i].program, voices, isa); };
    }
    tasks_.push_back(
        std::make_unique<KernelTask<T>>(kernels_[i], block_buffers(i), halo_buffers(i), make));
    all_.push_back(static_cast<std::uint32_t>(i));
    tasks.push_back(tasks_.back().get());
    most_nodes = std::max(most_nodes, shards_[i].nodes.size());
  }
  x_.resize(most_nodes);
  v_.resize(most_nodes);
  crew_ = form.executor->gather(std::move(tasks));
}

// Sets the points, which do not move. Lanes without a voice need them, too, because shards contain
// only the nodes around these points.
template <class T>
void ShardedKernel<T>::place_taps() {
  for (const TapSlot& tap : program_.taps) {
    for (const std::uint32_t c : {tap.u, tap.v}) {
      const double value =
          coefficient_value(program_, program_.coefficients[c], program_.parameters, 1.0);
      for (std::size_t lane = 0; lane < this->width(); ++lane) {
        this->coefficients.set(lane, c, value, false);
      }
    }
  }
}

template <class T>
BlockBuffers<T> ShardedKernel<T>::block_buffers(std::size_t i) const {
  const Shard& shard = shards_[i];
  const std::size_t width = this->width();
  BlockBuffers<T> buffers;
  buffers.outputs.resize(frames_ * shard.outputs.size() * width);
  buffers.value.resize(frames_ * shard.inputs.size() * width);
  buffers.velocity.resize(buffers.value.size());
  buffers.audio.resize(frames_ * program_.audio_coefficients.size() * width);
  return buffers;
}

template <class T>
HaloBuffers<T> ShardedKernel<T>::halo_buffers(std::size_t i) const {
  const Shard& shard = shards_[i];
  const std::size_t width = this->width();
  HaloBuffers<T> halo;
  halo.copies = shard.copies;
  halo.given = shard.given;
  halo.copied_x.resize(shard.copies.size() * width);
  halo.copied_v.resize(halo.copied_x.size());
  halo.coefficients.emplace_back(program_, width);
  halo.given_x.resize(shard.given.size() * width);
  halo.given_v.resize(halo.given_x.size());
  return halo;
}

template <class T>
void ShardedKernel<T>::set_state(std::size_t lane, const double* x, const double* v) {
  write_copies();
  for (std::size_t i = 0; i < shards_.size(); ++i) {
    const std::vector<std::uint32_t>& nodes = shards_[i].nodes;
    for (std::size_t node = 0; node < nodes.size(); ++node) {
      x_[node] = x[nodes[node]];
      v_[node] = v[nodes[node]];
    }
    kernels_[i]->set_state(lane, x_.data(), v_.data());
  }
}

template <class T>
bool ShardedKernel<T>::save(std::size_t lane, double* x, double* v) const {
  write_copies();
  for (std::size_t i = 0; i < shards_.size(); ++i) {
    const std::vector<std::uint32_t>& nodes = shards_[i].nodes;
    if (!kernels_[i]->save(lane, x_.data(), v_.data())) {
      return false;
    }
    for (std::size_t node = 0; node < nodes.size(); ++node) {
      x[nodes[node]] = x_[node];
      v[nodes[node]] = v_[node];
    }
  }
  return true;
}

// Every shard with the mass or a copy of it takes part.
template <class T>
void ShardedKernel<T>::strike(std::size_t lane, std::span<const std::uint32_t> nodes,
                              std::span<const double> changes) {
  write_copies();
  for (std::size_t i = 0; i < shards_.size(); ++i) {
    kernels_[i]->coefficients = this->coefficients;  // A voice may be struck before its first step.
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      if (const auto local = find(shards_[i], nodes[k])) {
        kernels_[i]->strike(lane, {&*local, 1}, changes.subspan(k, 1));
      }
    }
  }
}

template <class T>
bool ShardedKernel<T>::is_near_start(std::size_t lane, double bound) const {
  write_copies();
  return std::all_of(kernels_.begin(), kernels_.end(),
                     [&](const auto& kernel) { return kernel->is_near_start(lane, bound); });
}

// A copy is as good as the node itself. Nodes that are in no shard are at 0.
template <class T>
std::size_t ShardedKernel<T>::read_positions(std::size_t lane, std::span<const std::uint32_t> nodes,
                                             std::span<double> numbers) const {
  write_copies();
  return copy_positions(nodes, numbers, [&](std::uint32_t node) {
    double position = 0.0;
    for (std::size_t i = 0; i < shards_.size(); ++i) {
      if (const auto local = find(shards_[i], node)) {
        kernels_[i]->read_positions(lane, {&*local, 1}, {&position, 1});
        break;
      }
    }
    return position;
  });
}

template <class T>
void ShardedKernel<T>::play(const Block<T>& block) {
  for (std::size_t at = 0; at < block.frames; at += frames_) {
    const std::size_t frames = std::min(frames_, block.frames - at);
    for (std::size_t i = 0; i < shards_.size(); ++i) {
      give_inputs(i, block, at, frames);
    }
    crew_->run(all_);
    owes_copies_ = true;
    for (std::size_t i = 0; i < shards_.size(); ++i) {
      take_outputs(i, block, at, frames);
    }
  }
  this->coefficients = kernels_.front()->coefficients;
}

template <class T>
void ShardedKernel<T>::give_inputs(std::size_t i, const Block<T>& block, std::size_t at,
                                   std::size_t frames) {
  const Shard& shard = shards_[i];
  KernelTask<T>& task = *tasks_[i];
  const std::size_t width = this->width();
  task.frames = frames;
  task.halo.has_coefficients = at == 0;
  if (at == 0) {
    task.halo.coefficients[0] = this->coefficients;
  }
  task.halo.has_copies = owes_copies_;
  if (owes_copies_) {
    gather_copies(i);
  }
  std::size_t row = 0;
  for (std::size_t frame = at; frame < at + frames; ++frame) {
    for (const std::uint32_t input : shard.inputs) {
      const std::size_t from = frame * program_.inputs.size() + input;
      copy_row(block.value, from, task.buffers.value.data(), row, width);
      copy_row(block.velocity, from, task.buffers.velocity.data(), row++, width);
    }
  }
  const std::size_t audio = program_.audio_coefficients.size() * width;
  if (audio > 0) {
    std::copy_n(block.audio + at * audio, frames * audio, task.buffers.audio.data());
  }
}

template <class T>
void ShardedKernel<T>::take_outputs(std::size_t i, const Block<T>& block, std::size_t at,
                                    std::size_t frames) {
  std::size_t row = 0;
  for (std::size_t frame = at; frame < at + frames; ++frame) {
    for (const std::uint32_t output : shards_[i].outputs) {
      copy_row(tasks_[i]->buffers.outputs.data(), row++, block.outputs,
               frame * program_.outputs.size() + output, this->width());
    }
  }
}

template <class T>
void ShardedKernel<T>::gather_copies(std::size_t i) const {
  const std::size_t width = this->width();
  HaloBuffers<T>& halo = tasks_[i]->halo;
  T* x = halo.copied_x.data();
  T* v = halo.copied_v.data();
  for (const ShardSource& source : shards_[i].sources) {
    const HaloBuffers<T>& owner = tasks_[source.shard]->halo;
    x = std::copy_n(owner.given_x.data() + source.first * width, source.count * width, x);
    v = std::copy_n(owner.given_v.data() + source.first * width, source.count * width, v);
  }
}

// Writes the copies that the next block would start with, for readers between blocks.
template <class T>
void ShardedKernel<T>::write_copies() const {
  if (!owes_copies_) {
    return;
  }
  for (std::size_t i = 0; i < shards_.size(); ++i) {
    gather_copies(i);
    const HaloBuffers<T>& halo = tasks_[i]->halo;
    kernels_[i]->write_nodes(halo.copies, halo.copied_x.data(), halo.copied_v.data());
  }
  owes_copies_ = false;
}

template class ShardedKernel<float>;
template class ShardedKernel<double>;

}  // namespace ressort::kernels
