#include "app/mpi/ranks.h"

#include <mpi.h>

#include <cstdio>
#include <cstdlib>

#include "core/kernels/domains/one_by_one.h"

namespace ressort::mpi {
namespace {

std::size_t own_number() {
  int number = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &number);
  return static_cast<std::size_t>(number);
}

}  // namespace

// MPI's own handler ends all processes at the first error.
class Ranks::Post final : public Fellows {
 public:
  std::size_t own() const override { return own_; }

  void begin(std::span<const Parcel> parcels) override {
    for (const Parcel& parcel : parcels) {
      const auto owner = static_cast<int>(parcel.owner);
      const auto size = static_cast<int>(parcel.size);
      const auto tag = static_cast<int>(parcel.number);
      if (parcel.takers.empty()) {
        MPI_Ibcast(parcel.bytes, size, MPI_BYTE, owner, MPI_COMM_WORLD, &next());
      } else if (parcel.owner == own_) {
        for (const std::size_t taker : parcel.takers) {
          MPI_Isend(parcel.bytes, size, MPI_BYTE, static_cast<int>(taker), tag, MPI_COMM_WORLD,
                    &next());
        }
      } else {
        MPI_Irecv(parcel.bytes, size, MPI_BYTE, owner, tag, MPI_COMM_WORLD, &next());
      }
    }
  }

  void finish() override {
    MPI_Waitall(static_cast<int>(requests_.size()), requests_.data(), MPI_STATUSES_IGNORE);
    requests_.clear();
  }

  bool all_agree(bool here) override {
    int all = here ? 1 : 0;
    MPI_Allreduce(MPI_IN_PLACE, &all, 1, MPI_INT, MPI_LAND, MPI_COMM_WORLD);
    return all != 0;
  }

  // Machines with other processors might find another plan.
  void follow_first(std::span<std::uint32_t> numbers) override {
    const std::uint32_t here = numbers[0];
    MPI_Bcast(numbers.data(), static_cast<int>(numbers.size_bytes()), MPI_BYTE, 0, MPI_COMM_WORLD);
    if (!all_agree(here == numbers[0])) {
      std::fprintf(stderr,
                   "ressort-mpi: the machines step the network in different ways; take machines "
                   "with the same processors\n");
      MPI_Abort(MPI_COMM_WORLD, EXIT_FAILURE);
    }
  }

 private:
  MPI_Request& next() { return requests_.emplace_back(MPI_REQUEST_NULL); }

  const std::size_t own_ = own_number();
  std::vector<MPI_Request> requests_;
};

Ranks::Ranks(int& argc, char**& argv) {
  MPI_Init(&argc, &argv);
  post_ = std::make_unique<Post>();
}

Ranks::~Ranks() {
  MPI_Finalize();
}

std::size_t Ranks::number() const {
  return post_->own();
}

std::size_t Ranks::size() const {
  int size = 1;
  MPI_Comm_size(MPI_COMM_WORLD, &size);
  return static_cast<std::size_t>(size);
}

std::unique_ptr<Crew> Ranks::gather(std::vector<Task*> tasks) {
  return std::make_unique<OneByOne>(std::move(tasks));
}

Fellows* Ranks::fellows() {
  return post_.get();
}

void Ranks::abort(int code) {
  MPI_Abort(MPI_COMM_WORLD, code);
  std::_Exit(code);  // should it ever return
}

}  // namespace ressort::mpi
