#include "app/commands/body/mesher.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <thread>
#include <vector>

#include "app/commands/output.h"
#include "app/session/files.h"
#include "core/model/language/expression.h"

namespace ressort::commands {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr std::size_t max_mesh_bytes = std::size_t{1} << 31;
constexpr double most_unknowns = 3e5;  // unless twice the requested number is more
constexpr double far_off = 1.4;        // a mesh finer or coarser than this factor is made again

bool is_installed(const std::string& program) {
  const char* const path = std::getenv("PATH");
  std::string folders = path != nullptr ? path : "/usr/local/bin:/usr/bin:/bin";
  for (std::size_t from = 0; from <= folders.size();) {
    const std::size_t end = std::min(folders.find(':', from), folders.size());
    const std::string file = folders.substr(from, end - from) + "/" + program;
    if (access(file.c_str(), X_OK) == 0) {
      return true;
    }
    from = end + 1;
  }
  return false;
}

// Returns the last lines of a log.
std::string last_words(const std::string& log) {
  constexpr std::size_t most = 600;
  std::string text = read_bytes(log, max_mesh_bytes) ? *read_bytes(log, max_mesh_bytes) : "";
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) {
    text.pop_back();
  }
  if (text.size() > most) {
    text = text.substr(text.find('\n', text.size() - most) + 1);
  }
  for (char& c : text) {
    c = static_cast<unsigned char>(c) < 0x20 && c != '\n' ? ' ' : c;
  }
  return text.empty() ? "no messages" : "its last messages:\n" + text;
}

// A program that meshes, and what limits it.
struct Work {
  const TemporaryFolder& folder;  // The program runs there, with its output in the file "log".
  double limit_s;
  Clock::time_point end;
  const Progress::Callback& should_continue;
};

Result<Done> run(std::vector<std::string> words, const Work& work) {
  std::vector<char*> arguments;
  for (std::string& word : words) {
    arguments.push_back(word.data());
  }
  arguments.push_back(nullptr);
  const std::string log = work.folder.file("log");
  const pid_t child = fork();
  if (child < 0) {
    return Error{"cannot start " + words[0] + ": " +
                 std::error_code(errno, std::generic_category()).message()};
  }
  if (child == 0) {
    setpgid(0, 0);  // Ctrl-C reaches only this process, which then ends the child.
    prctl(PR_SET_PDEATHSIG, SIGKILL);  // the child ends with this process
    const int out = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    const int in = open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (out >= 0 && in >= 0 && chdir(work.folder.path().c_str()) == 0) {
      dup2(in, STDIN_FILENO);
      dup2(out, STDOUT_FILENO);
      dup2(out, STDERR_FILENO);
      execvp(arguments[0], arguments.data());
    }
    _exit(127);
  }
  int status = 0;
  for (;;) {
    const pid_t ended = waitpid(child, &status, WNOHANG);
    if (ended == child) {
      break;
    }
    if (ended < 0 && errno != EINTR) {
      return Error{"lost contact with " + words[0]};
    }
    const auto left = std::chrono::duration_cast<std::chrono::seconds>(work.end - Clock::now());
    const bool is_late = Clock::now() > work.end;
    if (is_late || !work.should_continue("meshing with " + words[0] + ", at most " +
                                         std::to_string(left.count()) + " s")) {
      kill(-child, SIGKILL);
      kill(child, SIGKILL);
      while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
      }
      return Error{is_late ? words[0] + " was stopped after " + print_number(work.limit_s) + " s"
                           : stopped};
    }
    std::this_thread::sleep_for(milliseconds(5));
  }
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    return Error{words[0] + " failed (" +
                 (WIFEXITED(status) ? "exit code " + std::to_string(WEXITSTATUS(status))
                                    : "signal " + std::to_string(WTERMSIG(status))) +
                 "); " + last_words(log)};
  }
  return Done{};
}

// Remeshes the surface in triangles of this size, or keeps the triangles of the file.
std::string gmsh_script(double edge, bool makes_surface_anew) {
  return std::string("General.Terminal = 1;\nMerge \"surface.stl\";\n") +
         (makes_surface_anew ? "ClassifySurfaces{40 * Pi / 180, 1, 1, Pi};\nCreateGeometry;\n"
                             : "") +
         "Surface Loop(1) = Surface{:};\nVolume(1) = {1};\n"
         "Mesh.MeshSizeFromPoints = 0;\nMesh.MeshSizeExtendFromBoundary = 1;\n"
         "Mesh.MeshSizeMax = " +
         print_number(edge) + ";\nMesh.Optimize = 1;\nMesh.SaveAll = 1;\n";
}

using Fill = std::function<Result<TetrahedronMesh>(double edge)>;

Result<TetrahedronMesh> by_gmsh(const ClosedSurface& closed, double edge, const Work& work) {
  Error first;
  for (const bool anew : {true, false}) {
    for (const auto& [name, text] : {std::pair("surface.stl", as_stl(closed)),
                                     std::pair("body.geo", gmsh_script(edge, anew))}) {
      if (auto written = write_text(work.folder.file(name), text, Existing::replace); !written) {
        return written.error();
      }
    }
    const auto ran =
        run({"gmsh", "-3", "body.geo", "-o", "body.mesh", "-v", "2", "-nt", "1"}, work);
    if (ran) {
      const auto text = read_bytes(work.folder.file("body.mesh"), max_mesh_bytes);
      auto mesh = text ? read_medit(*text) : Result<TetrahedronMesh>(text.error());
      if (mesh && !mesh->tetrahedra.empty()) {
        return mesh;
      }
      first = anew || mesh
                  ? Error{"gmsh produced no tetrahedra; " + last_words(work.folder.file("log"))}
                  : mesh.error();
    } else if (ran.error().message == stopped) {
      return ran.error();
    } else if (anew || first.message.empty()) {
      first = ran.error();
    }
  }
  return first;
}

Result<TetrahedronMesh> by_tetgen(const ClosedSurface& closed, double edge, const Work& work) {
  if (auto written =
          write_text(work.folder.file("body.smesh"), as_smesh(closed), Existing::replace);
      !written) {
    return written.error();
  }
  char switches[64];  // TetGen cannot read exponents here
  std::snprintf(switches, sizeof switches, "-pq1.4a%.24fgNEFQ", edge * edge * edge / 8.5);
  if (auto ran = run({"tetgen", switches, "body.smesh"}, work); !ran) {
    return ran.error();
  }
  const auto text = read_bytes(work.folder.file("body.1.mesh"), max_mesh_bytes);
  return text ? read_medit(*text)
              : Error{"tetgen produced no tetrahedra; " + last_words(work.folder.file("log"))};
}

std::size_t unknowns_of(const TetrahedronMesh& mesh) {
  const auto solid = quadratic(mesh);
  return solid ? solid->unknowns() : 0;
}

// Meshes again with another size if the first mesh is far from the requested number of unknowns.
// Returns an error if the surface has too many small triangles for this number.
Result<TetrahedronMesh> fitted(double edge, double unknowns, const Fill& fill) {
  auto mesh = fill(edge);
  if (!mesh) {
    return mesh;
  }
  double ratio = static_cast<double>(unknowns_of(*mesh)) / unknowns;
  if (ratio > 0.0 && (ratio > far_off || ratio < 1.0 / far_off)) {
    auto again = fill(edge * std::cbrt(ratio));
    if (again || again.error().message == stopped) {
      mesh = std::move(again);
      ratio = mesh ? static_cast<double>(unknowns_of(*mesh)) / unknowns : 0.0;
    }
  }
  if (ratio * unknowns > std::max(most_unknowns, 2.0 * unknowns)) {
    return Error{"the mesh would have " + std::to_string(std::lround(ratio * unknowns)) +
                 " unknowns"};
  }
  return mesh;
}

// Scales the mesh to the volume of the surface: straight edges cut off some of a round solid.
// Returns the share of the volume that it had.
double restore_volume(TetrahedronMesh& mesh, const ClosedSurface& closed) {
  double six = 0.0;
  for (const Tetrahedron& t : mesh.tetrahedra) {
    const auto point = [&](std::size_t i) { return mesh.points[static_cast<std::size_t>(t[i])]; };
    six += std::abs(inner(point(1) - point(0), cross(point(2) - point(0), point(3) - point(0))));
  }
  const double factor = std::cbrt(6.0 * closed.volume / six);
  if (factor > 0.9 && factor < 1.1) {
    const Box3 box = box_around(closed.surface.points);
    const Point3 middle = 0.5 * (box.low + box.high);
    for (Point3& point : mesh.points) {
      point = middle + factor * (point - middle);
    }
  }
  return 1.0 / (factor * factor * factor);
}

}  // namespace

Result<Meshed> fill_with_tetrahedra(const ClosedSurface& closed, const MeshOrder& order,
                                    const Progress::Callback& should_continue) {
  if (order.mesher == Mesher::automatic || order.mesher == Mesher::own) {
    if (const auto box = as_box(closed)) {
      return Meshed{oriented_box_mesh(*box, order.unknowns), "ressort, for boxes"};
    }
    if (const auto ball = as_ball(closed)) {
      Meshed meshed{detected_ball_mesh(*ball, order.unknowns), "ressort, for balls"};
      restore_volume(meshed.mesh, closed);
      return meshed;
    }
  }
  const double edge = edge_length(closed.volume, order.unknowns);
  struct Program {
    Mesher mesher;
    const char* name;
  };
  std::string failures;
  for (const Program& program :
       {Program{Mesher::gmsh, "gmsh"}, Program{Mesher::tetgen, "tetgen"}}) {
    if ((order.mesher != Mesher::automatic && order.mesher != program.mesher) ||
        !is_installed(program.name)) {
      continue;
    }
    const auto folder = TemporaryFolder::make();
    if (!folder) {
      return folder.error();
    }
    const Work work{*folder, order.limit_s,
                    Clock::now() + milliseconds(static_cast<std::int64_t>(1000.0 * order.limit_s)),
                    should_continue};
    auto mesh = fitted(edge, order.unknowns, [&](double size) {
      return program.mesher == Mesher::gmsh ? by_gmsh(closed, size, work)
                                            : by_tetgen(closed, size, work);
    });
    if (mesh) {
      restore_volume(*mesh, closed);
      return Meshed{*std::move(mesh), program.name, failures};
    }
    if (mesh.error().message == stopped) {
      return mesh.error();
    }
    failures += (failures.empty() ? "" : "\n") + mesh.error().message;
  }
  if (order.mesher == Mesher::own || (order.mesher == Mesher::automatic && !failures.empty())) {
    const Progress progress(should_continue);
    progress.stage("meshing with a grid");
    Meshed meshed{grid_mesh(closed, order.unknowns, progress), "ressort, on a grid", failures};
    if (!meshed.mesh.tetrahedra.empty()) {
      const double share = restore_volume(meshed.mesh, closed);
      meshed.failures += (failures.empty() ? "" : "\n") + std::string("the grid has ") +
                         std::to_string(std::lround(100.0 * share)) +
                         " % of the solid's volume; its modes are a rough estimate";
      return meshed;
    }
  }
  return Error{!failures.empty()
                   ? failures
                   : std::string(order.mesher == Mesher::automatic ? "neither gmsh nor tetgen is"
                                                                   : "the mesher is not") +
                         " installed; install the package gmsh, or pass --mesher own for a grid"};
}

}  // namespace ressort::commands
