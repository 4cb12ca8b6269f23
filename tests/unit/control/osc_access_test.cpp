// OSC access: allowed senders, reachable files and the reply budget.
#include <fcntl.h>
#include <ifaddrs.h>
#include <sys/stat.h>

#include <algorithm>
#include <future>

#include "app/control/osc/outlet.h"
#include "app/control/osc/server.h"
#include "app/control/registry.h"
#include "app/devices/audio.h"
#include "tests/support/app/data_folder.h"
#include "tests/support/app/osc_client.h"
#include "tests/support/catch.h"

namespace ressort::osc_access_test {
namespace {

constexpr std::int64_t ms = 1'000'000;
constexpr const char* whole = "@K param 0.1\n@o osc 1. K 0. 0. 0.\n@out1 posOutput @o\n";

std::uint32_t address_of(const std::string& text) {
  const auto subnets = parse_subnets(text);
  REQUIRE(subnets);
  REQUIRE(subnets->size() == 1);
  return (*subnets)[0].address;
}

std::string refusal(const OscOptions& options) {
  const auto allowed = allowed_senders(options);
  return allowed ? "" : allowed.error().message;
}

bool contains(const std::string& text, std::string_view part) {
  return text.find(part) != std::string::npos;
}

// A session that plays `whole`, and a server.
struct Harness {
  DataFolder data;
  Process process{48000.0, false};
  Session session{process, {.compile = {.rate_hz = 48000.0}}, {}};
  std::vector<std::string> news;  // Written by the server's thread; read after it has ended.
  bool is_loaded = load("one", whole);
  std::unique_ptr<OscServer> server = open({.port = 0});
  Client client{server->port()};

  Harness() { REQUIRE(is_loaded); }

  bool load(const std::string& name, std::string_view text) {
    data.write("models/" + name + ".mdl", text);
    return static_cast<bool>(session.load_and_wait(name));
  }
  std::unique_ptr<OscServer> open(const OscOptions& options) {
    auto opened = OscServer::open(options, process, session,
                                  [this](const std::string& text) { news.push_back(text); });
    REQUIRE(opened);
    return *std::move(opened);
  }

  std::string load_by_osc(const std::string& name) {
    const Answer answer = client.ask(message("/model/load", {name}));
    CHECK(answer.text(0) == "/model/load");
    return answer.address == "/done" ? "done" : answer.text(1);
  }
};

}  // namespace

// --- allowed senders -----------------------------------------------------------------------------

TEST_CASE("allowed senders are parsed as addresses and networks", "[osc_access]") {
  const auto subnets = parse_subnets("192.168.1.77/24,10.0.0.5,172.16.0.0/12");
  REQUIRE(subnets);
  REQUIRE(subnets->size() == 3);
  CHECK(print_subnet((*subnets)[0]) == "192.168.1.77/24");
  CHECK(print_subnet((*subnets)[1]) == "10.0.0.5");
  const auto may = [&](const std::string& address) {
    return may_send(*subnets, address_of(address));
  };
  CHECK(may("192.168.1.0"));
  CHECK(may("192.168.1.255"));
  CHECK_FALSE(may("192.168.0.255"));
  CHECK_FALSE(may("192.168.2.0"));
  CHECK(may("10.0.0.5"));
  CHECK_FALSE(may("10.0.0.4"));
  CHECK(may("172.31.255.255"));
  CHECK_FALSE(may("172.32.0.0"));
  CHECK(may("127.0.0.1"));
  CHECK_FALSE(may_send({}, address_of("10.0.0.5")));
  CHECK(may_send(*parse_subnets("0.0.0.0/0"), address_of("203.0.113.9")));
  for (const char* const wrong :
       {"192.168.1", "192.168.1.0/33", "192.168.1.0/", "256.0.0.1", "here", "1.2.3.4 ", " 1.2.3.4",
        "1.2.3.4.5", "1.2.3.-4", ",", "1.2.3.4,,"}) {
    INFO(wrong);
    CHECK_FALSE(parse_subnets(wrong));
  }
}

TEST_CASE("only named network senders are accepted", "[osc_access]") {
  CHECK(refusal({}) == "");
  CHECK(refusal({.bind_address = "127.0.0.2"}) == "");
  CHECK(contains(refusal({.bind_address = "0.0.0.0"}),
                 "such as --osc-allow 192.168.1.23 for one machine"));
  CHECK(contains(refusal({.bind_address = "192.168.1.2"}), "--osc-allow"));
  CHECK(refusal({.bind_address = "0.0.0.0", .allow = "10.0.0.0/8"}) == "");
  CHECK(contains(refusal({.allow = "10.0.0.0/8"}), "needs -B too"));
  CHECK(contains(refusal({.bind_address = "0.0.0.0", .allow = "everybody"}), "'everybody'"));
  CHECK(
      contains(refusal({.bind_address = "0.0.0.0/0"}), "is not an address that OSC can listen on"));
  Harness harness;
  CHECK(harness.server->access() == "accessible from this machine only");
  CHECK(harness.open({.bind_address = "0.0.0.0", .port = 0, .allow = "10.0.0.0/8,10.1.2.3"})
            ->access() == "accessible from this machine and 10.0.0.0/8, 10.1.2.3");
}

TEST_CASE("packets from other senders are counted and ignored", "[osc_access]") {
  // An address of this machine other than 127.x, like a remote one.
  std::uint32_t own = 0;
  ifaddrs* all = nullptr;
  REQUIRE(getifaddrs(&all) == 0);
  for (const ifaddrs* at = all; at != nullptr; at = at->ifa_next) {
    if (at->ifa_addr != nullptr && at->ifa_addr->sa_family == AF_INET) {
      sockaddr_in address{};
      std::memcpy(&address, at->ifa_addr, sizeof address);
      const std::uint32_t found = ntohl(address.sin_addr.s_addr);
      own = is_this_machine(found) ? own : found;
    }
  }
  freeifaddrs(all);
  if (own == 0) {
    WARN("no network: nobody else can send");
    return;
  }
  Harness harness;
  const std::string other = own == address_of("10.9.8.7") ? "10.9.8.6" : "10.9.8.7";
  auto closed = harness.open({.bind_address = "0.0.0.0", .port = 0, .allow = other});
  Client stranger(closed->port(), own);
  for (int i = 0; i < 3; ++i) {
    stranger.send(message("/bend", {0.5f}));
  }
  stranger.send(message("/status"));
  CHECK_FALSE(stranger.receive(500));
  CHECK(harness.process.from_osc.size() == 0);
  CHECK(harness.session.status().strangers == 4);
  Client local(closed->port());
  CHECK(local.ask(message("/status")).address == "/status.reply");
  closed.reset();
  REQUIRE(harness.news.size() == 1);
  CHECK(contains(harness.news[0], "--osc-allow " + print_address(own) + " lets it in"));

  const auto open =
      harness.open({.bind_address = "0.0.0.0", .port = 0, .allow = print_address(own)});
  Client guest(open->port(), own);
  CHECK(guest.ask(message("/status")).address == "/status.reply");
}

// --- reply budget --------------------------------------------------------------------------------

TEST_CASE("replies are limited to the bytes received plus a budget", "[osc_access]") {
  constexpr std::size_t question = 16;
  constexpr std::size_t answer = 1596;
  constexpr int seconds = 10;
  AnswerBudget budget;
  const OscSender sender{0x0a000001, 4000};
  double sent = 0.0;
  double answered = 0.0;
  int tellings = 0;
  int pauses = 0;
  bool was_heard = true;
  for (std::int64_t t = 0; t < seconds * 1000; ++t) {
    for (int i = 0; i < 10; ++i) {
      budget.received(sender, question, t * ms);
      sent += question;
      const bool is_heard = budget.may_answer(sender, t * ms);
      if (is_heard) {
        budget.answered(sender, answer, t * ms);
        answered += answer;
      }
      pauses += was_heard && !is_heard ? 1 : 0;
      tellings += !is_heard && budget.reply_pause_s(sender, t * ms) > 0.0 ? 1 : 0;
      was_heard = is_heard;
    }
  }
  const double most = sent + (seconds + 1) * AnswerBudget::bytes_per_s;
  CHECK(answered <= most + answer);
  CHECK(answered >= most - 2 * answer);
  CHECK(tellings > 0);
  CHECK(tellings <= pauses);
}

TEST_CASE("a started reply is sent whole and charged to the budget", "[osc_access]") {
  AnswerBudget budget;
  const OscSender sender{0x0a000001, 4000};
  CHECK(budget.may_answer(sender, 0));
  CHECK(budget.reply_pause_s(sender, 0) == 0.0);
  budget.answered(sender, 3 * 65536, 0);
  CHECK_FALSE(budget.may_answer(sender, 0));
  CHECK(budget.reply_pause_s(sender, 0) == 2.0);
  CHECK(budget.reply_pause_s(sender, 1) == 0.0);
  CHECK_FALSE(budget.may_answer(sender, 2000 * ms - 1));
  CHECK(budget.may_answer(sender, 2001 * ms));
  budget.answered(sender, 1000, 2001 * ms);
  CHECK(budget.reply_pause_s(sender, 2001 * ms) > 0.0);
}

TEST_CASE("remote ports share a budget, local ports have their own", "[osc_access]") {
  AnswerBudget budget;
  budget.answered({0x0a000001, 1}, 70000, 0);
  CHECK_FALSE(budget.may_answer({0x0a000001, 2}, 0));
  CHECK(budget.may_answer({0x0a000002, 1}, 0));
  budget.answered({0x7f000001, 1}, 70000, 0);
  CHECK_FALSE(budget.may_answer({0x7f000001, 1}, 0));
  CHECK(budget.may_answer({0x7f000001, 2}, 0));
}

TEST_CASE("memory is limited for any number of senders", "[osc_access]") {
  AnswerBudget budget;
  for (std::uint32_t i = 0; i < 100'000; ++i) {
    budget.received({0x0a000000 + i, 1}, 16, 0);
  }
  CHECK(budget.senders() <= AnswerBudget::max_senders + 1);
  std::size_t answered = 0;
  for (std::uint32_t i = 0; i < 100'000; ++i) {
    if (budget.may_answer({0x0b000000 + i, 1}, 0)) {
      budget.answered({0x0b000000 + i, 1}, 66000, 0);
      ++answered;
    }
  }
  CHECK(answered == AnswerBudget::max_senders + 1);
  CHECK(budget.senders() == AnswerBudget::max_senders + 1);
  // A client that has used no budget frees its entry.
  CHECK(budget.may_answer({0x0c000000, 1}, 1000 * ms));
}

TEST_CASE("a reply of many rows is sent in portions", "[osc_access]") {
  const int receiver = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  REQUIRE(bind(receiver, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
  const OscSender to{INADDR_LOOPBACK, static_cast<std::uint16_t>(port_of(receiver))};
  OscOutlet outlet(socket(AF_INET, SOCK_DGRAM, 0), {});
  std::vector<std::uint8_t> got;
  const auto collect = [&] {
    std::uint8_t byte = 0;
    while (recv(receiver, &byte, 1, MSG_DONTWAIT) == 1) {
      got.push_back(byte);
    }
    return got.size();
  };
  CHECK(outlet.send_due() == -1);
  std::vector<OscOutlet::Bytes> rows;
  for (std::uint8_t i = 0; i < 100; ++i) {
    rows.push_back({i});
  }
  outlet.answer(to, rows);
  outlet.answer(to, {{100}});  // Replies queued behind the others.
  CHECK(collect() == 0);
  const int wait_ms = outlet.send_due();
  CHECK(wait_ms > 0);
  CHECK(wait_ms <= 6);
  CHECK(collect() == 16);
  while (outlet.send_due() > 0) {
  }
  CHECK(collect() == 101);
  CHECK(std::is_sorted(got.begin(), got.end()));
  outlet.answer(to, {{101}});  // Sent without waiting.
  CHECK(collect() == 102);
  close(receiver);
}

TEST_CASE("a description of a thousand parameters arrives complete and in order", "[osc_access]") {
  Harness harness;
  std::string text;
  const std::string stem = "p" + std::string(60, '_');
  for (int i = 0; i < 1000; ++i) {
    text += "@" + stem + std::to_string(1000 + i) + " param 0.1\n";
  }
  REQUIRE(harness.load("many", text + whole));
  harness.client.send(message("/describe"));
  harness.client.send(message("/bend", {0.5f}));
  harness.client.send(message("/nowhere"));
  std::vector<Answer> rows;
  while (rows.empty() || rows.back().address != "/describe.end") {
    auto row = harness.client.receive();
    REQUIRE(row);
    rows.push_back(*std::move(row));
  }
  CHECK(std::get<std::int32_t>(rows.back().values.at(0)) == static_cast<int>(rows.size()) - 1);
  rows.pop_back();
  REQUIRE(rows.size() == addresses().size() + 2 * 1001);  // Each parameter is a control, too.
  for (std::size_t i = 0; i < 1000; ++i) {
    CHECK(rows[addresses().size() + i].text(0) == "/param/" + stem + std::to_string(1000 + i));
  }
  // The reply exceeded the budget: no further replies for a while, with one message about it.
  const auto pause = harness.client.receive();
  REQUIRE(pause);
  CHECK(pause->address == "/error");
  CHECK(contains(pause->text(1), "notes are still played"));
  CHECK(harness.process.from_osc.size() == 1);
}

TEST_CASE("a flood of queries is not amplified", "[osc_access]") {
  Harness harness;
  const std::int64_t start_ns = monotonic_ns();
  const Bytes question = message("/describe");
  constexpr std::size_t count = 5000;
  for (std::size_t i = 0; i < count; ++i) {
    harness.client.send(question);
  }
  harness.client.sync();
  const double seconds = 1e-9 * static_cast<double>(monotonic_ns() - start_ns);
  constexpr double one_answer = 4000.0;
  CHECK(static_cast<double>(harness.client.bytes_received) <=
        static_cast<double>(count * question.size()) + (seconds + 1.0) * AnswerBudget::bytes_per_s +
            one_answer);
  // Another client still gets replies.
  CHECK(Client(harness.server->port()).ask(message("/status")).address == "/status.reply");
}

TEST_CASE("packets that the system lost are counted", "[osc_access]") {
  Harness harness;
  const Bytes packet =
      bundle(1, {message("/bend", {0.5f}), message("/done", {std::string(8000, 'x')})});
  // Sends faster than the server reads, until the socket's buffer overflows.
  std::size_t sent = 0;
  std::size_t heard = 0;
  for (int round = 0; round < 100 && harness.session.status().dropped == 0; ++round) {
    for (std::size_t i = 0; i < 2000; ++i, ++sent) {
      harness.client.send(packet);
    }
    CHECK(Client(harness.server->port()).sync().empty());
    for (TimedEvent event; harness.process.from_osc.pop(event);) {
      ++heard;
    }
  }
  const std::size_t lost = harness.session.status().dropped;
  CHECK(heard > 0);
  CHECK(lost > 0);
  CHECK(heard + lost >= sent);
}

// --- reachable files -----------------------------------------------------------------------------

TEST_CASE("packets load only files below the program's folders", "[osc_access]") {
  namespace fs = std::filesystem;
  Harness harness;
  const fs::path outside = harness.data.path().string() + "_outside";
  fs::create_directories(outside);
  const auto write = [](const fs::path& path, std::string_view text) {
    std::ofstream(path) << text;
  };
  write(outside / "secret.mdl", whole);
  write(outside / "secret.toml", "model = \"secret.mdl\"\n");
  write(outside / "secret", "root:x:0:0");
  const fs::path models = harness.data.path("models");
  const fs::path presets = harness.data.path("presets");
  fs::create_directories(models / "sub");
  write(models / "sub/inner.mdl", whole);
  write(models / "plain.txt", whole);
  fs::create_symlink(models / "sub/inner.mdl", models / "within.mdl");
  fs::create_symlink(outside / "secret.mdl", models / "link.mdl");
  fs::create_symlink(outside / "secret", models / "text.mdl");
  fs::create_symlink(models / "plain.txt", models / "other.mdl");
  fs::create_directory_symlink(outside, models / "door");
  fs::create_symlink("/dev/zero", models / "zero.mdl");
  REQUIRE(mkfifo((models / "pipe.mdl").c_str(), 0600) == 0);
  write(presets / "good.toml", "model = \"one.mdl\"\n");
  write(presets / "up.toml", "model = \"../../" + outside.filename().string() + "/secret.mdl\"\n");
  write(presets / "absolute.toml", "model = \"" + (outside / "secret.mdl").string() + "\"\n");
  write(presets / "linked.toml", "model = \"link.mdl\"\n");
  write(presets / "password.toml", "model = \"/etc/passwd\"\n");

  for (const char* const name : {"one", "one.mdl", "sub/inner", "within", "good", "good.toml",
                                 "../models/one", "sub/../one.mdl", "../presets/good"}) {
    INFO(name);
    CHECK(harness.load_by_osc(name) == "done");
  }
  const std::string up = "../../" + outside.filename().string();
  for (const std::string& name : {std::string("../../etc/passwd"),
                                  std::string("/etc/passwd"),
                                  std::string("/dev/zero"),
                                  std::string("models/../../x"),
                                  up + "/secret",
                                  up + "/secret.mdl",
                                  up + "/secret.toml",
                                  (outside / "secret").string(),
                                  (outside / "secret.mdl").string(),
                                  (models / "one.mdl").string(),
                                  std::string("plain.txt"),
                                  std::string("other"),
                                  std::string("link"),
                                  std::string("text"),
                                  std::string("door/secret"),
                                  std::string("zero"),
                                  std::string("pipe"),
                                  std::string("sub"),
                                  std::string("."),
                                  std::string("..")}) {
    INFO(name);
    CHECK(contains(harness.load_by_osc(name), "OSC cannot load"));
  }
  for (const char* const name : {"up", "absolute", "linked"}) {
    INFO(name);
    CHECK(harness.load_by_osc(name) ==
          name + std::string(".toml:1:9: error: its model is outside the "
                             "program's folders, so OSC cannot load it"));
    CHECK(harness.session.load_and_wait(presets /
                                        // A local user may load it.
                                        (name + std::string(".toml"))));
  }
  CHECK(contains(harness.load_by_osc("password"), "password.toml:1:9: error: "));
  // The locally loaded model is still playing.
  CHECK(harness.session.load_and_wait(outside / "secret.mdl"));
  fs::remove_all(outside);
}

TEST_CASE("replies contain no text of a file", "[osc_access]") {
  Harness harness;
  const std::string rest = "@out1 posOutput @m\n";
  const std::string mass = "@m mass 1. 0. 0.\n";
  const std::vector<std::string> models = {
      "hunter2:x:0:0:\n",
      "@m hunter2 1. 0. 0.\n",
      "@m mass hunter2 0. 0.\n",
      "@m mass 1. hunter2 0.\n",
      "@m mass 1. 'hunter2' 0.\n",
      "@m mass 1. it's'hunter2's 0.\n",
      "@m mass hunter2(3) 0. 0.\n",
      "@m mass [1 + hunter2] 0. 0.\n",
      "@m mass 1. [0. hunter2 0.] 0.\n",
      "@hunter2 mass 1. 0. 0.\n@hunter2 mass 1. 0. 0.\n",
      mass + "@r spring @m @hunter2 0.1\n",
      "@hunter2 mass 1. 0. 0.\n@r spring @hunter @hunter2 0.1\n",
      mass + "@r spring @m hunter2 0.1\n",
      mass + "@hunter2 frcInput @m\n",
      mass + "@p param hunter2\n",
      "@s string hunter2 1. 0.1 0.001 0. 0.\n",
      mass + "@out2 posOutput [@hunter2 0.3]\n",
      mass + "~end hunter2\n",
      "@hunter2 param 9.\n@m osc 1. hunter2 0. 0. 0.\n",
      "@hunter2 param -1.\n@m mass hunter2*2 0. 0.\n",
  };
  const std::string model = "model = \"named.mdl\"\n";
  const std::string control = model + "[[control]]\nto = \"in1\"\n";
  const std::vector<std::string> presets = {
      "hunter2:x:0:0:\n",
      model + "hunter2 = 1\n",
      model + "hunter2 = 1\nhunter2 = 2\n",
      model + "hunter2\n",
      model + "voices = hunter2\n",
      model + "[hunter2]\nx = 1\n",
      model + "budget = \"hunter2=3\"\n",
      model + "budget = \"cents=hunter2\"\n",
      model + "[parameters]\nhunter2 = 3\n",
      model + "[parameters]\nhunter2 = { value = 9, range = [0, 1] }\n",
      model + "[parameters]\nnone = { value = 1, range = [0, 1] }\n",
      model + "[[control]]\nfrom = \"cc1\"\nto = \"none\"\n",
      model + "[[control]]\nfrom = \"cc1\"\nto = \"none\\nhunter2\"\n",
      control + "from = \"hunter2\"\n",
      control + "from = \"/param/hunter2\"\n",
      control + "how = \"hunter2\"\n",
      "model = \"hunter2\"\n",
      "model = \"hunter2.mdl\"\n",
  };
  harness.data.write("models/named.mdl", "@hunter2 param 0.1\n" + mass + rest);
  std::size_t quoting = 0;
  const auto check = [&](const std::string& file, const std::string& text) {
    harness.data.write(file, text);
    const std::string name = std::filesystem::path(file).filename().string();
    const std::string told = harness.load_by_osc(name);
    const auto here = harness.session.load_and_wait(harness.data.path(file));
    INFO(text << told);
    REQUIRE_FALSE(here);
    INFO(here.error().message);
    quoting += contains(here.error().message, "hunter2") ? 1 : 0;
    CHECK(told.starts_with(name + ":"));
    CHECK_FALSE(contains(told, "hunter"));
    CHECK_FALSE(contains(told, harness.data.path().string()));
  };
  for (const std::string& text : models) {
    check("models/secret.mdl", text + rest);
  }
  for (const std::string& text : presets) {
    check("presets/secret.toml", text);
  }
  CHECK(quoting > models.size());  // A local user sees the quoted words.
  harness.server.reset();
  REQUIRE_FALSE(harness.news.empty());
  CHECK(contains(harness.news[0], "secret.mdl:1:"));
  CHECK(without_source("a.mdl:1:3: error: unknown keyword 'x'; did you mean 'y'?") ==
        "a.mdl:1:3: error: unknown keyword '...'");
  CHECK(without_source("/b/a.mdl:2:1: warning: 'x'\n/b/a.mdl:2:3: error: found 'x' where a "
                       "parameter's value, a number, was expected") ==
        "a.mdl:2:3: error: found '...' where a parameter's value, a number, was expected");
  CHECK(without_source("there is no model 'x'; there are y, z") ==
        "there is no model 'x'; there are y, z");
}

}  // namespace ressort::osc_access_test
