// app/panel: the web page of the running program and its HTTP server. It is a client of the
// registry and of OSC: it can send what OSC can, and nothing else.
//
//  GET /             the page and its other files
//  GET /describe     the registry and the current scene (state.h)
//  GET /network      the drawing (picture.h)
//  GET /modes?count=N    the lowest modes and their shapes (picture.h)
//  GET /motion?hz=30&slow=1   frames of positions, chunked, until one side closes (motion.h)
//  GET /events       server-sent events: loaded, values, status, news
//  POST /osc         one OSC packet; replies come back as a bundle
// Any other path, and / for clients that do not accept HTML, queries the tree of addresses
// (osc_query.h).
#pragma once

#include <memory>
#include <string>

#include "app/control/osc/server.h"
#include "app/panel/motion.h"
#include "app/session/session.h"

namespace ressort::panel {

struct PanelOptions {
  std::string bind_address = "127.0.0.1";
  int port = 0;  // 0: no panel.
};

class WebPanel {
 public:
  static constexpr int usual_port = 9788;
  static constexpr std::size_t most_body_bytes = 64 << 10;
  static constexpr int most_viewers = 4;  // For /motion and for /events each.
  static constexpr int idle_s = 3;        // Time limit of an idle client, and so of a shutdown.

  // Opens the panel; fails if the port is in use. All arguments must outlive it. `port` may be 0
  // for any free port. [control]
  static Result<std::unique_ptr<WebPanel>> open(const PanelOptions& options, Process& process,
                                                Session& session, MotionFeed& motion,
                                                OscServer& osc);
  ~WebPanel();

  std::string address() const;  // Address to open in a browser, with its token.
  bool is_for_all() const;      // True if other machines can reach it.

  // Shows a message in the page's list of errors. [any thread but audio]
  void show_message(const std::string& news);

 private:
  struct Server;
  explicit WebPanel(std::unique_ptr<Server> server);
  std::unique_ptr<Server> server_;
};

}  // namespace ressort::panel
