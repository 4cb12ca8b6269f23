#include "core/kernels/direct/direct.h"

#include <algorithm>

namespace ressort::kernels {

template <class T>
DirectKernel<T>::DirectKernel(const Program& program, const Direct&, std::size_t voices, Isa isa)
    : NodeKernel<T>(program, layout_in_rows<T>(program, lanes_for<T>(voices, isa), 3)),
      loops_(with_isa(
          isa, [&]<Isa level>() { return direct_loops<level, T>(this->width() * sizeof(T)); })),
      rails_(program, this->width()) {
  this->reset_lanes();
}

template <class T>
DirectState<T> DirectKernel<T>::state() {
  DirectState<T> state(ramps_of(this->coefficients), this->nodes_);
  state.rails = rails_.is_empty() ? nullptr : &rails_;
  return state;
}

template <class T>
void DirectKernel<T>::play(const Block<T>& block) {
  rails_.prepare(this->coefficients.value.data());
  DirectState<T> played = state();
  loops_.step(this->program_, played, block);
  this->coefficients.finish(block.frames);
}

template class DirectKernel<float>;
template class DirectKernel<double>;

}  // namespace ressort::kernels
