#include "app/control/osc/outlet.h"

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <limits>

#include "app/devices/audio.h"

namespace ressort::control {
namespace {

constexpr int max_loads_waiting = 16;
constexpr std::size_t max_waiting_bytes = std::size_t{8} << 20;
// A socket with default settings holds about 270 small packets.
constexpr std::size_t portion = 16;
constexpr std::int64_t portion_ns = 5'000'000;

}  // namespace

OscOutlet::OscOutlet(int socket, Log log) : socket_(socket), log_(std::move(log)) {}

OscOutlet::~OscOutlet() {
  close();
}

void OscOutlet::received(const OscSender& from, std::size_t bytes) {
  const std::lock_guard lock(mutex_);
  budget_.received(from, bytes, monotonic_ns());
}

bool OscOutlet::may_answer(const OscSender& to) {
  const std::lock_guard lock(mutex_);
  return budget_.may_answer(to, monotonic_ns());
}

double OscOutlet::reply_pause_s(const OscSender& to) {
  const std::lock_guard lock(mutex_);
  return budget_.reply_pause_s(to, monotonic_ns());
}

bool OscOutlet::has_room() {
  const std::lock_guard lock(mutex_);
  return waiting_bytes_ < max_waiting_bytes;
}

void OscOutlet::answer(const OscSender& to, std::vector<Bytes> answers) {
  const std::lock_guard lock(mutex_);
  std::size_t size = 0;
  for (const Bytes& bytes : answers) {
    size += bytes.size();
  }
  budget_.answered(to, size, monotonic_ns());
  const auto line = waiting_.find({to.address, to.port});
  if (answers.size() == 1 && line == waiting_.end()) {
    send(to, answers[0]);
  } else if (!answers.empty()) {
    auto& waiting = waiting_[{to.address, to.port}].answers;
    std::move(answers.begin(), answers.end(), std::back_inserter(waiting));
    waiting_bytes_ += size;
  }
}

int OscOutlet::send_due() {
  const std::lock_guard lock(mutex_);
  if (waiting_.empty()) {
    return -1;
  }
  const std::int64_t now_ns = monotonic_ns();
  std::int64_t next_ns = std::numeric_limits<std::int64_t>::max();
  for (auto at = waiting_.begin(); at != waiting_.end();) {
    auto& [to, line] = *at;
    for (std::size_t i = 0; i < portion && line.due_ns <= now_ns && !line.answers.empty(); ++i) {
      send({to.first, to.second}, line.answers.front());
      waiting_bytes_ -= line.answers.front().size();
      line.answers.pop_front();
    }
    line.due_ns = line.due_ns <= now_ns ? now_ns + portion_ns : line.due_ns;
    next_ns = std::min(next_ns, line.due_ns);
    at = line.answers.empty() ? waiting_.erase(at) : std::next(at);
  }
  return waiting_.empty() ? -1 : static_cast<int>((next_ns - now_ns) / 1'000'000 + 1);
}

void OscOutlet::send(const OscSender& to, const Bytes& bytes) {
  if (socket_ < 0) {
    return;
  }
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(to.address);
  address.sin_port = htons(to.port);
  // Errors are ignored: the client is gone, and UDP does not guarantee delivery.
  sendto(socket_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&address),
         sizeof address);
}

void OscOutlet::log(const std::string& news) const {
  if (log_) {
    log_(news);
  }
}

void OscOutlet::log_failure(const std::string& news) {
  std::optional<std::string> due;
  {
    const std::lock_guard lock(mutex_);
    failures_.add(news);
    due = failures_.take();
  }
  if (due) {
    log(*due);
  }
}

void OscOutlet::close() {
  const std::lock_guard lock(mutex_);
  if (socket_ >= 0) {
    ::close(socket_);
    socket_ = -1;
  }
}

bool OscOutlet::begin_load() {
  const std::lock_guard lock(mutex_);
  if (loads_waiting_ >= max_loads_waiting) {
    return false;
  }
  ++loads_waiting_;
  return true;
}

void OscOutlet::end_load() {
  const std::lock_guard lock(mutex_);
  --loads_waiting_;
}

}  // namespace ressort::control
