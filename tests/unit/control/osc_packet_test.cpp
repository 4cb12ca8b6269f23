#include "app/control/osc/packet.h"

#include "tests/support/app/osc_bytes.h"
#include "tests/support/catch.h"
#include "tests/support/rooms.h"

namespace ressort::osc_packet_test {
namespace {

TEST_CASE("check_packet returns the messages of valid packets", "[osc_packet]") {
  const Bytes single = RAW("/a\0\0,i\0\0\0\0\0\7");
  const auto one = check_packet(single);
  REQUIRE(one);
  REQUIRE(one->size() == 1);
  CHECK(one->front().bytes.size() == 12);
  CHECK(one->front().time_tag == 1);

  CHECK(check_packet(RAW("/abc\0\0\0\0,\0\0\0")));
  CHECK(check_packet(RAW("/a\0\0,TFNI\0\0\0")));
  CHECK(
      check_packet(RAW("/a\0\0,hdt\0\0\0\0"
                       "12345678abcdefgh\0\0\0\0\0\0\0\1")));
  CHECK(check_packet(RAW("/a\0\0,sSb\0\0\0\0text\0\0\0\0abc\0\0\0\0\5hello\0\0\0")));
  CHECK(check_packet(RAW("/a\0\0,crm\0\0\0\0\0\0\0xRGBA\1\2\3\4")));
  CHECK(check_packet(RAW("/a\0\0,b\0\0\0\0\0\0")));

  const auto empty = check_packet(bundle(5, {}));
  REQUIRE(empty);
  CHECK(empty->empty());

  const Bytes outer =
      bundle(5, {message("/a"), bundle(7, {message("/b", {1, 2.5f})}), message("/c")});
  const auto nested = check_packet(outer);
  REQUIRE(nested);
  REQUIRE(nested->size() == 3);
  CHECK((*nested)[0].time_tag == 5);
  CHECK((*nested)[1].time_tag == 7);
  CHECK((*nested)[2].time_tag == 5);
  CHECK((*nested)[2].bytes[1] == 'c');
}

TEST_CASE("check_packet rejects every kind of invalid packet", "[osc_packet]") {
  const auto refused = [](const Bytes& bytes, std::string_view because) {
    const auto result = check_packet(bytes);
    INFO(because);
    REQUIRE_FALSE(result);
    INFO(result.error().message);
    CHECK(result.error().message.find(because) != std::string::npos);
  };
  refused({}, "not 0");
  refused(RAW("/a\0\0,\0\0"), "multiple of 4");
  refused(Bytes(max_osc_packet_bytes + 1), "at most 65507 bytes");
  refused(RAW("abc\0,\0\0\0"), "begin with '/'");
  refused(RAW("\0\0\0\0,\0\0\0"), "begin with '/'");
  refused(RAW("/\x7f\0\0,\0\0\0"), "printable");
  refused(RAW("/\xc3\xa4\0,\0\0\0"), "printable");
  refused(RAW("/abc"), "an address does not end");
  refused(RAW("/a\0x,\0\0\0"), "an address is not padded");
  refused(RAW("/a\0\0"), "no type tags");
  refused(RAW("/a\0\0i\0\0\0\0\0\0\0"), "begin with ','");
  refused(RAW("/a\0\0,iii"), "a type tag string does not end");
  refused(RAW("/a\0\0,\0\0i"), "a type tag string is not padded");
  refused(RAW("/a\0\0,[]\0"), "not one of");
  refused(RAW("/a\0\0,i\0\0"), "fewer arguments");
  refused(RAW("/a\0\0,d\0\0\0\0\0\0"), "fewer arguments");
  refused(RAW("/a\0\0,\0\0\0\0\0\0\0"), "longer than its type tags say");
  refused(RAW("/a\0\0,s\0\0abcd"), "a string argument does not end");
  refused(RAW("/a\0\0,s\0\0a\0\0x"), "a string argument is not padded");
  refused(RAW("/a\0\0,b\0\0"), "a blob's size is missing");
  refused(RAW("/a\0\0,b\0\0\0\0\0\5abcd"), "a blob is longer");
  refused(RAW("/a\0\0,b\0\0\xff\xff\xff\xff"), "a blob is longer");
  refused(RAW("/a\0\0,b\0\0\0\0\0\1axxx"), "a blob is not padded");
  refused(RAW("#bundl\0\0\0\0\0\0\0\0\0\1"), "#bundle");
  refused(RAW("#bundle\0\0\0\0\1"), "#bundle");
  refused(RAW("#bundle\0\0\0\0\0\0\0\0\1\0\0\0\0"), "not 0");
  refused(RAW("#bundle\0\0\0\0\0\0\0\0\1\0\0\0\6/a\0\0,\0\0\0"), "multiple of 4");
  refused(RAW("#bundle\0\0\0\0\0\0\0\0\1\0\0\0\x0c/a\0\0,\0\0\0"), "longer than the bundle");
  refused(RAW("#bundle\0\0\0\0\0\0\0\0\1\xff\xff\xff\xfc"), "longer than the bundle");
  refused(bundle(1, {message("/a"), RAW("/b\0\0")}), "no type tags");

  Bytes deep = message("/a");
  for (int depth = 0; depth < max_osc_bundle_depth; ++depth) {
    deep = bundle(1, {deep});
  }
  CHECK(check_packet(deep));
  refused(bundle(1, {deep}), "depth");
}

}  // namespace
}  // namespace ressort::osc_packet_test
