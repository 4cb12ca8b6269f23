#include "core/kernels/domains/sharded.h"

#include <algorithm>

namespace ressort {
namespace {

// Rows of one table copied to other places in another; a row is a number for each lane.
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
    : ShardedKernel(program, form, kernels_of<T>(form, voices, isa)) {}

template <class T>
ShardedKernel<T>::ShardedKernel(const Program& program, const Shards& form, Kernels kernels)
    : Kernel<T>(program, kernels[0]->width()),
      program_(program),
      shards_(*form.shards),
      executor_(*form.executor),
      frames_(form.frames),
      kernels_(std::move(kernels)) {
  const std::size_t width = this->width();
  for (const Shard& shard : shards_) {
    Buffers& buffers = buffers_.emplace_back();
    buffers.value.resize(frames_ * shard.inputs.size() * width);
    buffers.velocity.resize(buffers.value.size());
    buffers.outputs.resize(frames_ * shard.outputs.size() * width);
    buffers.given_x.resize(shard.given.size() * width);
    buffers.given_v.resize(buffers.given_x.size());
    buffers.copied_x.resize(shard.copies.size() * width);
    buffers.copied_v.resize(buffers.copied_x.size());
    buffers.x.resize(shard.nodes.size());
    buffers.v.resize(shard.nodes.size());
  }
}

template <class T>
void ShardedKernel<T>::set_state(std::size_t lane, const double* x, const double* v) {
  for (std::size_t i = 0; i < shards_.size(); ++i) {
    Buffers& buffers = buffers_[i];
    for (std::size_t node = 0; node < buffers.x.size(); ++node) {
      buffers.x[node] = x[shards_[i].nodes[node]];
      buffers.v[node] = v[shards_[i].nodes[node]];
    }
    kernels_[i]->set_state(lane, buffers.x.data(), buffers.v.data());
  }
}

template <class T>
bool ShardedKernel<T>::save(std::size_t lane, double* x, double* v) const {
  for (std::size_t i = 0; i < shards_.size(); ++i) {
    Buffers& buffers = buffers_[i];
    if (!kernels_[i]->save(lane, buffers.x.data(), buffers.v.data())) {
      return false;
    }
    for (std::size_t node = 0; node < buffers.x.size(); ++node) {
      x[shards_[i].nodes[node]] = buffers.x[node];
      v[shards_[i].nodes[node]] = buffers.v[node];
    }
  }
  return true;
}

// All that have the mass or a copy of it feel it.
template <class T>
bool ShardedKernel<T>::strike(std::size_t lane, std::uint32_t node, double change) {
  bool is_struck = false;
  for (std::size_t i = 0; i < shards_.size(); ++i) {
    const std::vector<std::uint32_t>& own = shards_[i].nodes;
    const auto at = std::lower_bound(own.begin(), own.end(), node);
    if (at != own.end() && *at == node) {
      is_struck |= kernels_[i]->strike(lane, static_cast<std::uint32_t>(at - own.begin()), change);
    }
  }
  return is_struck;
}

template <class T>
bool ShardedKernel<T>::is_near_start(std::size_t lane, double bound) const {
  return std::all_of(kernels_.begin(), kernels_.end(),
                     [&](const auto& kernel) { return kernel->is_near_start(lane, bound); });
}

// A copy is as good as the node itself; nodes that no shard has are at 0.
template <class T>
std::size_t ShardedKernel<T>::look(std::size_t lane, std::span<const std::uint32_t> nodes,
                                   std::span<double> numbers) const {
  return look_at(nodes, numbers, [&](std::uint32_t node) {
    double position = 0.0;
    for (std::size_t i = 0; i < shards_.size(); ++i) {
      const std::vector<std::uint32_t>& own = shards_[i].nodes;
      const auto at = std::lower_bound(own.begin(), own.end(), node);
      if (at != own.end() && *at == node) {
        const auto local = static_cast<std::uint32_t>(at - own.begin());
        kernels_[i]->look(lane, {&local, 1}, {&position, 1});
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
    const auto step = [&](std::size_t i) { step_shard(i, block, at, frames); };
    executor_.run(shards_.size(), std::ref(step));
    const auto write = [&](std::size_t i) { write_copies(i); };
    executor_.run(shards_.size(), std::ref(write));
  }
  this->coefficients = kernels_[0]->coefficients;
}

template <class T>
void ShardedKernel<T>::step_shard(std::size_t i, const Block<T>& block, std::size_t at,
                                  std::size_t frames) {
  const Shard& shard = shards_[i];
  Kernel<T>& kernel = *kernels_[i];
  Buffers& buffers = buffers_[i];
  const std::size_t width = this->width();
  if (at == 0) {
    kernel.coefficients = this->coefficients;
  }
  std::size_t row = 0;
  for (std::size_t frame = at; frame < at + frames; ++frame) {
    for (const std::uint32_t input : shard.inputs) {
      const std::size_t from = frame * program_.inputs.size() + input;
      copy_row(block.value, from, buffers.value.data(), row, width);
      copy_row(block.velocity, from, buffers.velocity.data(), row++, width);
    }
  }
  const std::size_t audio = at * program_.audio_coefficients.size() * width;
  kernel.step({.frames = frames,
               .value = buffers.value.data(),
               .velocity = buffers.velocity.data(),
               .audio = block.audio == nullptr ? nullptr : block.audio + audio,
               .outputs = buffers.outputs.data()});
  row = 0;
  for (std::size_t frame = at; frame < at + frames; ++frame) {
    for (const std::uint32_t output : shard.outputs) {
      copy_row(buffers.outputs.data(), row++, block.outputs,
               frame * program_.outputs.size() + output, width);
    }
  }
  kernel.read(shard.given, buffers.given_x.data(), buffers.given_v.data());
}

template <class T>
void ShardedKernel<T>::write_copies(std::size_t i) {
  const Shard& shard = shards_[i];
  Buffers& buffers = buffers_[i];
  const std::size_t width = this->width();
  T* x = buffers.copied_x.data();
  T* v = buffers.copied_v.data();
  for (const ShardSource& source : shard.sources) {
    const Buffers& owner = buffers_[source.shard];
    x = std::copy_n(owner.given_x.data() + source.first * width, source.count * width, x);
    v = std::copy_n(owner.given_v.data() + source.first * width, source.count * width, v);
  }
  kernels_[i]->write_nodes(shard.copies, buffers.copied_x.data(), buffers.copied_v.data());
}

template class ShardedKernel<float>;
template class ShardedKernel<double>;

}  // namespace ressort
