// app/control: decides who may send OSC and how many bytes are sent in reply. Pure: works on
// addresses, sizes and times.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "app/rooms.h"
#include "core/result.h"

namespace ressort::control {

// IPv4 sender of a packet, in host byte order.
struct OscSender {
  std::uint32_t address = 0;
  std::uint16_t port = 0;
};

// A range of addresses with a common prefix.
struct Subnet {
  std::uint32_t address = 0;
  int prefix_bits = 32;
};

// Parses "192.168.1.0/24,10.0.0.5"; an empty text gives none.
Result<std::vector<Subnet>> parse_subnets(std::string_view text);

bool is_this_machine(std::uint32_t address);  // Returns true for 127.x.x.x.

// Returns true for this machine and the subnets.
bool may_send(std::span<const Subnet> allowed, std::uint32_t address);

std::string print_address(std::uint32_t address);  // Returns for example "192.168.1.5".
std::string print_subnet(const Subnet& subnet);    // Returns for example "192.168.1.0/24".

// Limits replies, because a small query can have a large reply, and its sender address can be
// forged (amplification). Each address gets at most the bytes it has sent plus `bytes_per_s`, of
// which one second's worth can accumulate. A reply that has begun is sent whole; the excess is a
// debt, and no further reply is sent until it is paid.
class AnswerBudget {
 public:
  static constexpr double bytes_per_s = 65536.0;
  static constexpr std::size_t max_senders = 256;  // Further senders share one budget.

  void received(const OscSender& from, std::size_t bytes, std::int64_t now_ns);
  bool may_answer(const OscSender& to, std::int64_t now_ns);
  void answered(const OscSender& to, std::size_t bytes, std::int64_t now_ns);

  // Returns the time until replies resume; 0 if the client has already been told.
  double reply_pause_s(const OscSender& to, std::int64_t now_ns);

  std::size_t senders() const { return accounts_.size(); }

 private:
  struct Account {
    double bytes = bytes_per_s;
    std::int64_t time_ns = 0;
    bool was_informed = false;
  };

  Account& account(const OscSender& sender, std::int64_t now_ns);

  // A sender without an entry has its full budget.
  std::unordered_map<std::uint64_t, Account> accounts_;
};

}  // namespace ressort::control
