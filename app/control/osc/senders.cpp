#include "app/control/osc/senders.h"

#include <algorithm>
#include <charconv>
#include <optional>

namespace ressort::control {
namespace {

// Takes a whole number up to `most` from the front of `text`.
std::optional<std::uint32_t> take_number(std::string_view& text, std::uint32_t most) {
  std::uint32_t number = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (failure != std::errc{} || number > most) {
    return std::nullopt;
  }
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return number;
}

bool take(std::string_view& text, char c) {
  const bool is_there = text.starts_with(c);
  text.remove_prefix(is_there ? 1 : 0);
  return is_there;
}

std::optional<Subnet> parse_subnet(std::string_view text) {
  Subnet subnet;
  for (int i = 0; i < 4; ++i) {
    if (i > 0 && !take(text, '.')) {
      return std::nullopt;
    }
    const auto byte = take_number(text, 255);
    if (!byte) {
      return std::nullopt;
    }
    subnet.address = subnet.address << 8 | *byte;
  }
  if (take(text, '/')) {
    const auto bits = take_number(text, 32);
    if (!bits) {
      return std::nullopt;
    }
    subnet.prefix_bits = static_cast<int>(*bits);
  }
  return text.empty() ? std::optional(subnet) : std::nullopt;
}

bool contains(const Subnet& subnet, std::uint32_t address) {
  const std::uint64_t hosts = std::uint64_t{1} << (32 - subnet.prefix_bits);
  return subnet.address / hosts == address / hosts;
}

constexpr std::uint64_t all_others = ~std::uint64_t{0};

// On this machine the port identifies the client. Remote ports are ignored, because a client with a
// forged address could use any port.
std::uint64_t key_of(const OscSender& sender) {
  return std::uint64_t{sender.address} << 16 | (is_this_machine(sender.address) ? sender.port : 0u);
}

}  // namespace

Result<std::vector<Subnet>> parse_subnets(std::string_view text) {
  std::vector<Subnet> subnets;
  while (!text.empty()) {
    const std::string_view word = text.substr(0, text.find(','));
    const auto subnet = parse_subnet(word);
    if (!subnet) {
      return Error{
          "expected addresses such as 192.168.1.23 or 192.168.1.0/24, separated by commas, "
          "found '" +
          std::string(word) + "'"};
    }
    subnets.push_back(*subnet);
    text.remove_prefix(std::min(text.size(), word.size() + 1));
  }
  return subnets;
}

bool is_this_machine(std::uint32_t address) {
  return address >> 24 == 127;
}

bool may_send(std::span<const Subnet> allowed, std::uint32_t address) {
  return is_this_machine(address) || std::ranges::any_of(allowed, [&](const Subnet& subnet) {
           return contains(subnet, address);
         });
}

std::string print_address(std::uint32_t address) {
  return std::to_string(address >> 24) + "." + std::to_string(address >> 16 & 255) + "." +
         std::to_string(address >> 8 & 255) + "." + std::to_string(address & 255);
}

std::string print_subnet(const Subnet& subnet) {
  const std::string address = print_address(subnet.address);
  return subnet.prefix_bits == 32 ? address : address + "/" + std::to_string(subnet.prefix_bits);
}

AnswerBudget::Account& AnswerBudget::account(const OscSender& sender, std::int64_t now_ns) {
  const auto saved_up = [&](const Account& account) {
    const double more = bytes_per_s * 1e-9 * static_cast<double>(now_ns - account.time_ns);
    return std::min(account.bytes + more, bytes_per_s);
  };
  std::uint64_t key = key_of(sender);
  if (accounts_.size() >= max_senders && !accounts_.contains(key)) {
    std::erase_if(accounts_,
                  [&](const auto& entry) { return saved_up(entry.second) == bytes_per_s; });
    key = accounts_.size() >= max_senders ? all_others : key;
  }
  Account& account = accounts_.try_emplace(key, Account{.time_ns = now_ns}).first->second;
  account.bytes = saved_up(account);
  account.time_ns = now_ns;
  account.was_informed = account.was_informed && account.bytes <= 0.0;
  return account;
}

void AnswerBudget::received(const OscSender& from, std::size_t bytes, std::int64_t now_ns) {
  Account& account = this->account(from, now_ns);
  account.bytes = std::min(account.bytes + static_cast<double>(bytes), bytes_per_s);
}

bool AnswerBudget::may_answer(const OscSender& to, std::int64_t now_ns) {
  return account(to, now_ns).bytes > 0.0;
}

void AnswerBudget::answered(const OscSender& to, std::size_t bytes, std::int64_t now_ns) {
  account(to, now_ns).bytes -= static_cast<double>(bytes);
}

double AnswerBudget::reply_pause_s(const OscSender& to, std::int64_t now_ns) {
  Account& account = this->account(to, now_ns);
  const bool tells = account.bytes <= 0.0 && !account.was_informed;
  account.was_informed = account.was_informed || tells;
  return tells ? -account.bytes / bytes_per_s : 0.0;
}

}  // namespace ressort::control
