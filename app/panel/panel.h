// app/panel: the web page of a program that plays, and the HTTP that it talks. A face of the
// registry and of OSC: it can say what OSC can, and nothing else.
//
//   GET /             the page, and its other files
//   GET /describe     the registry and what sounds (state.h)
//   GET /network      what is drawn (picture.h)
//   GET /modes?count=N    the lowest modes and their shapes (picture.h)
//   GET /motion?hz=30&slow=1   frames of positions, chunked, until one side ends it (motion.h)
//   GET /events       server-sent: loaded, values, status, news
//   POST /osc         one OSC packet; answers come back as a bundle
// Any other path, and / for who does not want HTML, asks for the tree of addresses (osc_query.h).
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "app/control/osc/server.h"
#include "app/panel/motion.h"
#include "app/session/session.h"

namespace ressort::panel {

struct PanelOptions {
  std::string bind_address = "127.0.0.1";
  int port = 0;  // 0: no panel
};

class WebPanel {
 public:
  static constexpr int usual_port = 9788;
  static constexpr std::size_t most_body_bytes = 64 << 10;
  static constexpr int most_viewers = 4;  // of /motion, and of /events
  static constexpr int idle_s = 3;        // of one who asks or listens; so long may the end take

  // Fails where the port is taken, saying so. All of these outlive it; `port` may be 0 here for any
  // that is free. [control]
  static Result<std::unique_ptr<WebPanel>> open(const PanelOptions& options, Process& process,
                                                Session& session, MotionFeed& motion,
                                                OscServer& osc);
  ~WebPanel();

  std::string address() const;  // to be opened in a browser, with its token
  bool is_for_all() const;      // bound to an address beyond this machine's own

  // The page's list of complaints has it too. [any thread but audio]
  void tell(const std::string& news);

 private:
  struct Server;
  explicit WebPanel(std::unique_ptr<Server> server);
  std::unique_ptr<Server> server_;
};

}  // namespace ressort::panel
