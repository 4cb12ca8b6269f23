// app/control: who may send OSC, and how much is answered to whom. Pure: addresses, sizes and times
// in.
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

// Where a packet comes from: IPv4, in this machine's order of bytes.
struct OscSender {
  std::uint32_t address = 0;
  std::uint16_t port = 0;
};

// The addresses that have their first bits in common.
struct Subnet {
  std::uint32_t address = 0;
  int prefix_bits = 32;
};

// "192.168.1.0/24,10.0.0.5"; an empty text has none.
Result<std::vector<Subnet>> parse_subnets(std::string_view text);

bool is_this_machine(std::uint32_t address);  // 127.x.x.x

// This machine and the subnets.
bool may_send(std::span<const Subnet> allowed, std::uint32_t address);

std::string print_address(std::uint32_t address);  // "192.168.1.5"
std::string print_subnet(const Subnet& subnet);    // "192.168.1.0/24"

// A small question may have a large answer, and who asks may give another's address for his own. So
// nobody is sent more than he has sent and `bytes_per_s` on top, of which a second's worth may be
// saved up. What has begun is sent whole and owed: nothing more is answered until it is made up
// for.
class AnswerBudget {
 public:
  static constexpr double bytes_per_s = 65536.0;
  static constexpr std::size_t max_senders = 256;  // the others have one budget together

  void received(const OscSender& from, std::size_t bytes, std::int64_t now_ns);
  bool may_answer(const OscSender& to, std::int64_t now_ns);
  void answered(const OscSender& to, std::size_t bytes, std::int64_t now_ns);

  // How long it takes until there is an answer again; 0 if it was told since there was one.
  double tell_pause_s(const OscSender& to, std::int64_t now_ns);

  std::size_t senders() const { return accounts_.size(); }

 private:
  struct Account {
    double bytes = bytes_per_s;
    std::int64_t time_ns = 0;
    bool was_informed = false;
  };

  Account& account(const OscSender& sender, std::int64_t now_ns);

  std::unordered_map<std::uint64_t, Account> accounts_;  // who is not here has saved up all
};

}  // namespace ressort::control
