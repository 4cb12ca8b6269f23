#include "core/model/faust/faust_passive.h"

namespace ressort::model {
namespace {

constexpr FaustDefinition definitions[] = {
    // The value of g where x + gamma g(x) = free, between `far` and `free`: Newton, and by halves
    // where that would step too far or g falls too steeply (core/laws/discrete_gradient.h).
    {"between",
     "between(count, g, far, start, free, gamma) =\n"
     "  min(far, free), max(far, free), max(min(far, free), min(max(far, free), start)) :\n"
     "  seq(i, count, nearer) : !, !, _ : arrived\n"
     "with {\n"
     "  nearer(low, high, x) = g(x) : go with {\n"
     "    go(value, slope) = bottom, top, select2(fits, 0.5*(bottom + top), newton) with {\n"
     "      over = x - free + gamma*value;\n"
     "      steep = 1.0 + gamma*slope;\n"
     "      bottom = select2(over < 0.0, low, x);\n"
     "      top = select2(over < 0.0, x, high);\n"
     "      newton = x - over/steep;\n"
     "      fits = (newton >= bottom) & (newton <= top) & (steep > 0.0);\n"
     "    };\n"
     "  };\n"
     "  arrived(x) = g(x) : last with {\n"
     "    last(value, slope) = value - slope*(x - free + gamma*value)/(1.0 + gamma*slope);\n"
     "  };\n"
     "};\n"},
    // The same of a g that rises, with a damper.
    {"risen",
     "risen(g, z, way, gamma) = between(24, both, way - gamma*(both(way) : _, !), way, way, "
     "gamma)\n"
     "with {\n"
     "  both(s) = g(s) : +(z*s), +(z);\n"
     "};\n"},
    // A potential's energy e, force f and slope g between two places; the middle where both are one
    {"discrete",
     "discrete(e, f, g, b, s) =\n"
     "  select2(is_near, quotient, f(b + 0.5*s)),\n"
     "  select2(is_near, (f(b + s) - quotient)/wide, 0.5*g(b + 0.5*s))\n"
     "with {\n"
     "  far = abs(b) + abs(b + s);\n"
     "  is_near = abs(s) <= max(0.000004*far, select2(far < 1e-150, 0.0, 1.0));\n"
     "  wide = select2(is_near, s, 1.0);\n"
     "  quotient = (e(b + s) - e(b))/wide;\n"
     "};\n"},
    // What starts as it stands in the very first sample: no higher than there may it rise.
    {"first_alone",
     "first_alone(g, before, speed, way, gamma) =\n"
     "  select2(abs(force)*gamma > abs(way), force, way/gamma)\n"
     "with {\n"
     "  falls = (g(before, speed) : _, !)*speed < 0.0;\n"
     "  lead = select2(falls, 0.0, speed);\n"
     "  force = between(48, risen_from, 0.0, way, way, gamma);\n"
     "  risen_from(s) = g(before + lead, s - lead) : gated with {\n"
     "    gated(value, slope) = select2(rises, 0.0, share), select2(rises, 0.0, bend) with {\n"
     "      w = s - lead;\n"
     "      rises = (value*w > 0.0) & (select2(falls, 1.0, w*speed) > 0.0);\n"
     "      wide = select2(falls & rises, 1.0, s);\n"
     "      share = select2(falls, value, value*w/wide);\n"
     "      bend = select2(falls, slope, (value + slope*w - share)/wide);\n"
     "    };\n"
     "  };\n"
     "};\n"},

    {"gradient_spring", "gradient_spring(k, z, b, s) = k*(b + 0.5*s), 0.5*k;\n"},

    {"steady_quadratic_spring",
     "steady_quadratic_spring(k, q, z, now, speed, way) = k*now + z*speed, 0.0;\n"},
    {"gradient_quadratic_spring",
     "gradient_quadratic_spring(k, q, z, b, s) = side*f, select2(crosses, q/3.0*(a + a + c),\n"
     "  (q*a*a - f)/both)\n"
     "with {\n"
     "  after = b + s;\n"
     "  a = abs(after);\n"
     "  c = abs(b);\n"
     "  crosses = after*b < 0.0;\n"
     "  side = select2(select2(crosses, after + b, after) < 0.0, 1.0, 0.0 - 1.0);\n"
     "  both = select2(crosses, 1.0, a + c);\n"
     "  f = q/3.0*(a*a + a*c + c*c)*select2(crosses, 1.0, (a - c)/both);\n"
     "};\n"},
    {"alone_quadratic_spring",
     "alone_quadratic_spring(k, q, z, f, damping, b, speed, way, gamma) =\n"
     "  f + risen(gradient_quadratic_spring(k, q, z, b), damping, way - gamma*f, gamma);\n"},

    {"steady_cubic_spring",
     "steady_cubic_spring(k, q, z, now, speed, way) = k*now + z*speed, 0.0;\n"},
    {"gradient_cubic_spring",
     "gradient_cubic_spring(k, q, z, b, s) = 0.25*q*(a + b)*(a*a + b*b), 0.25*q*(3.0*a*a + "
     "2.0*a*b + b*b)\n"
     "with {\n"
     "  a = b + s;\n"
     "};\n"},
    {"alone_cubic_spring",
     "alone_cubic_spring(k, q, z, f, damping, b, speed, way, gamma) =\n"
     "  f + risen(gradient_cubic_spring(k, q, z, b), damping, way - gamma*f, gamma);\n"},

    // What a clipped spring or contact holds at a distance, how it pulls, and how that grows.
    {"clipped_energy",
     "clipped_energy(s, c, k, d) = select2(c*d*d <= k - s, 0.5*k*d*d - less, d*d*(0.5*s + "
     "0.25*c*d*d))\n"
     "with {\n"
     "  less = select2(c > 0.0, 0.0, (k - s)*(k - s)/select2(c > 0.0, 1.0, 4.0*c));\n"
     "};\n"},
    {"clipped_force", "clipped_force(s, c, k, d) = d*select2(c*d*d <= k - s, k, s + c*d*d);\n"},
    {"clipped_slope", "clipped_slope(s, c, k, d) = select2(c*d*d <= k - s, k, s + 3.0*c*d*d);\n"},

    {"steady_clipped_spring",
     "steady_clipped_spring(s, c, k, z, now, speed, way) = 0.0,\n"
     "  0.5*select2(c == 0.0, select2(s >= k, select2(c > 0.0, beyond, bent), z), z)\n"
     "with {\n"
     "  beyond = z + 0.3*k;\n"
     "  bent = select2(c*now*now <= k - s, beyond, z);\n"
     "};\n"},
    {"gradient_clipped_spring",
     "gradient_clipped_spring(s, c, k, z) = discrete(clipped_energy(low, bend, high),\n"
     "  clipped_force(low, bend, high), clipped_slope(low, bend, high))\n"
     "with {\n"
     "  is_bent = (c > 0.0) & (s < k);\n"
     "  low = select2(is_bent, high, s);\n"
     "  bend = select2(is_bent, 0.0, c);\n"
     "  high = select2(c == 0.0, k, s);\n"
     "};\n"},
    {"alone_clipped_spring",
     "alone_clipped_spring(s, c, k, z, f, damping, b, speed, way, gamma) =\n"
     "  f + risen(gradient_clipped_spring(s, c, k, z, b), damping, way - gamma*f, gamma);\n"},

    // It goes the first of all ways that keep the energy (core/laws/pluck.h).
    {"steady_pluck",
     "steady_pluck(k, s, z, now, speed, way) = 0.0, select2(abs(now) < s, 0.0, 0.5*z);\n"},
    {"gradient_pluck",
     "gradient_pluck(k, s, z, d, way) = foot, other_foot, top, other_top : added\n"
     "with {\n"
     "  side = select2(d + 0.5*way > 0.0, 1.0, 0.0 - 1.0);\n"
     "  b = side*d;\n"
     "  foot = ramp(b + s);\n"
     "  other_foot = ramp(b - s);\n"
     "  top = ramp(b + s/10.0);\n"
     "  other_top = ramp(b - s/10.0);\n"
     "  added(v1, s1, v2, s2, v3, s3, v4, s4) =\n"
     "    side*k*(0.1*(v1 - v2) - (v3 - v4)), k*(0.1*(s1 - s2) - (s3 - s4));\n"
     "  ramp(x) = 0.5*(after + before)*select2(is_up, share, 1.0),\n"
     "    select2(is_up, select2(before > 0.0, square, share - square), 0.5)\n"
     "  with {\n"
     "    go = side*way;\n"
     "    before = max(0.0, x);\n"
     "    after = max(0.0, x + go);\n"
     "    is_up = min(before, after) > 0.0;\n"
     "    share = (after - before)/select2(go == 0.0, go, 1.0);\n"
     "    square = 0.5*share*share;\n"
     "  };\n"
     "};\n"},
    {"alone_pluck",
     "alone_pluck(k, s, z, f, damping, before, speed, way, gamma) =\n"
     "  select2(way < gamma*force, 1.0, 0.0 - 1.0) : facing\n"
     "with {\n"
     "  inner = s/10.0;\n"
     "  m = 1.0 + gamma*damping;\n"
     "  force = select2(abs(before) < s, 0.0, select2(abs(before) < inner, outside, (0.0 - "
     "0.9)*k*before));\n"
     "  outside = k/10.0*(before - select2(before < 0.0, s, 0.0 - s));\n"
     "  hill(d) = select2(abs(d) < s, 0.0, 0.05*k*slope*slope + 0.45*k*max(0.0, inner*inner - "
     "d*d))\n"
     "  with {\n"
     "    slope = s - max(abs(d), inner);\n"
     "  };\n"
     "  facing(side) = side*before, side*way, hill(before) : climb : *(side) : found;\n"
     "  climb(b, free, height) = free/m, select2(b > s, 0.0, 1.0) :\n"
     "    piece(0.0 - 1e30, 0.0 - s, 0.0, 0.0, 0.0) : piece(0.0 - s, 0.0 - inner, 0.0, 0.1*k, "
     "0.0 - s) :\n"
     "    piece(0.0 - inner, inner, hill(0.0), 0.0 - 0.9*k, 0.0) :\n"
     "    piece(inner, s, 0.0, 0.1*k, s) : piece(s, 1e30, 0.0, 0.0, 0.0) : _, !\n"
     "  with {\n"
     "    piece(from, to, level, bend, middle, old, has) =\n"
     "      m + 0.5*gamma*bend, gamma*bend*there - free, gamma*(level + 0.5*bend*there*there - "
     "height) : solve\n"
     "    with {\n"
     "      there = b - middle;\n"
     "      solve(square, linear, rest) = square, linear, rest,\n"
     "        linear*linear - 4.0*square*select2((b >= from) & (b < to), rest, 0.0) : root;\n"
     "      root(square, linear, rest, inside) = square, linear, rest, inside, sqrt(max(0.0, "
     "inside)) : first;\n"
     "      first(square, linear, rest, inside, root) = inside,\n"
     "        select2(linear < 0.0, linear + root, 2.0*square),\n"
     "        select2(linear < 0.0, 0.0 - 2.0*rest, root - linear) : divided;\n"
     "      divided(inside, bottom, top) = inside, bottom, top/select2(bottom == 0.0, bottom, 1.0) "
     ": judged;\n"
     "      judged(inside, bottom, go) = go,\n"
     "        ((inside >= 0.0) & (bottom != 0.0) & (go >= 0.0) & (b < to) &\n"
     "        (b + go <= to + slack) & (b + go >= from - slack)) : chosen with {\n"
     "          slack = 3.6e-15*(s + abs(b) + go);\n"
     "        };\n"
     "      chosen(go, is_here) = select2(is_here & (has < 0.5), old, go), select2(is_here, has, "
     "1.0);\n"
     "    };\n"
     "  };\n"
     "  found(step) = gradient_pluck(k, s, z, before, step) : pulls with {\n"
     "    pulls(value, bend) = select2(way == gamma*force, pull, force) with {\n"
     "      pull = value + damping*step - (bend + damping)*more;\n"
     "      steep = m + gamma*bend;\n"
     "      over = m*step - way + gamma*value;\n"
     "      more = select2(abs(steep) > 0.001, 0.0, over/steep);\n"
     "    };\n"
     "  };\n"
     "};\n"},

    {"steady_bow", "steady_bow(z, s, now, speed, way) = 0.0, 0.0;\n"},
    {"gradient_bow",
     "gradient_bow(z, s, b, step) = select2(fast < s, 0.0, select2(fast < s/3.0, beyond, "
     "2.0*z*v/3.0)),\n"
     "  select2(fast < s, 0.0, select2(fast < s/3.0, (0.0 - z)/6.0, z/3.0))\n"
     "with {\n"
     "  v = 0.5*step;\n"
     "  fast = abs(v);\n"
     "  beyond = z/3.0*(select2(v < 0.0, s, 0.0 - s) - v);\n"
     "};\n"},
    {"alone_bow",
     "alone_bow(z, s, f, damping, b, speed, way, gamma) =\n"
     "  side*select2(give > 0.0, select2(remains, 0.0, held), select2(sticks, slipping, held))\n"
     "with {\n"
     "  half = 0.5*gamma;\n"
     "  side = select2(way < 0.0, 1.0, 0.0 - 1.0);\n"
     "  fast = 0.5*side*way;\n"
     "  stuck = 1.0 + 2.0*half*z/3.0;\n"
     "  held = 2.0*z/3.0*fast/stuck;\n"
     "  give = 1.0 - half*z/3.0;\n"
     "  slips = (fast - half*s*z/3.0)/give;\n"
     "  slipping = select2(fast >= s, z/3.0*(s - slips), 0.0);\n"
     "  sticks = fast < s/3.0*stuck;\n"
     "  remains = sticks & (select2(fast < s, select2(side*speed < slips, 0.0, 1.0), 1.0) > 0.5);\n"
     "};\n"},
    {"steady_smooth_bow", "steady_smooth_bow(z, s, now, speed, way) = 0.0, 0.0;\n"},
    {"gradient_smooth_bow",
     "gradient_smooth_bow(z, s, b, step) = rubbed(z, s, 0.5*step) : _, *(0.5);\n"},
    {"rubbed",
     "rubbed(z, s, v) = grip*v, grip*(1.0 - 8.0*ratio*ratio)\n"
     "with {\n"
     "  ratio = min(1000.0, abs(v/s));\n"
     "  grip = 0.63*z*exp(0.5 - 4.0*ratio*ratio);\n"
     "};\n"},
    {"alone_smooth_bow",
     "alone_smooth_bow(z, s, f, damping, b, speed, way, gamma) =\n"
     "  between(24, rubbed(z, s), 0.0, speed, 0.5*way, 0.5*gamma);\n"},
    {"steady_either_bow", "steady_either_bow(z, s, p, now, speed, way) = 0.0, 0.0;\n"},
    {"gradient_either_bow",
     "gradient_either_bow(z, s, p, b, step) = gradient_bow(z, s, b, step), gradient_smooth_bow(z, "
     "s, b, step) : chosen\n"
     "with {\n"
     "  chosen(v1, s1, v2, s2) = select2(p > 0.0, v1, v2), select2(p > 0.0, s1, s2);\n"
     "};\n"},
    {"alone_either_bow",
     "alone_either_bow(z, s, p, f, damping, b, speed, way, gamma) = select2(p > 0.0,\n"
     "  alone_bow(z, s, f, damping, b, speed, way, gamma),\n"
     "  alone_smooth_bow(z, s, f, damping, b, speed, way, gamma));\n"},

    // Of the two samples that a damper acts over, how much is inside, by depths.
    {"inside",
     "inside(before, now, after) = 0.5*(share(before, now) + share(now, after))\n"
     "with {\n"
     "  share(a, b) = select2(a == b, (max(0.0, b) - max(0.0, a))/select2(a == b, b - a, 1.0),\n"
     "    select2(a > 0.0, 0.0, 1.0));\n"
     "};\n"},
    {"steady_contact",
     "steady_contact(k, z, t, now, speed, way) = 0.0,\n"
     "  0.5*z*inside(now - speed + t, now + t, now - speed + way + t);\n"},
    {"gradient_contact",
     "gradient_contact(k, z, t, b, s) = 0.5*k*(p + q)*select2(is_in, x - y, 1.0),\n"
     "  0.5*k*select2(is_in, 2.0*x - x*x + y*y, 1.0)\n"
     "with {\n"
     "  p = max(0.0, b + t + s);\n"
     "  q = max(0.0, b + t);\n"
     "  is_in = min(p, q) > 0.0;\n"
     "  wide = select2(is_in, select2(s == 0.0, s, 1.0), 1.0);\n"
     "  x = p/wide;\n"
     "  y = q/wide;\n"
     "};\n"},
    // In closed form (core/laws/contact.h).
    {"alone_contact",
     "alone_contact(k, z, t, f, damping, b, speed, a, gamma) = elastic + damping*step\n"
     "with {\n"
     "  u = b + t;\n"
     "  h = 0.5*gamma*k;\n"
     "  m = 1.0 + gamma*damping;\n"
     "  in = (a - 2.0*h*u)/(m + h);\n"
     "  bounce = sqrt(a*a + 4.0*m*h*u*u);\n"
     "  out = select2(a > 0.0, (a - bounce)/(2.0*m), (0.0 - 2.0)*h*u*u/(a + bounce));\n"
     "  past = a + u*m;\n"
     "  c = a + 2.0*m*u;\n"
     "  hit = sqrt(max(0.0, c*c - 4.0*(m + h)*u*past));\n"
     "  p = select2(c < 0.0, (c + hit)/(2.0*(m + h)), (0.0 - 2.0)*u*past/(hit - c));\n"
     "  stays = (u > 0.0) & (u + in >= 0.0);\n"
     "  step = select2(u > 0.0, select2(past > 0.0, a/m, p - u), select2(stays, out, in));\n"
     "  over(square, way) = square/(2.0*select2(way == 0.0, way, 1.0));\n"
     "  elastic = select2(u > 0.0, select2(past > 0.0, 0.0, over(k*p*p, p - u)),\n"
     "    select2(stays, over((0.0 - k)*u*u, out), k*(u + 0.5*in)));\n"
     "};\n"},
    {"steady_clipped_contact",
     "steady_clipped_contact(s, c, k, z, t, now, speed, way) = 0.0,\n"
     "  0.5*z*inside(now - speed + t, now + t, now - speed + way + t);\n"},
    {"gradient_clipped_contact",
     "gradient_clipped_contact(s, c, k, z, t, b) = discrete(wall(clipped_energy(low, bend, "
     "high)),\n"
     "  wall(clipped_force(low, bend, high)), wall(clipped_slope(low, bend, high)), b + t)\n"
     "with {\n"
     "  wall(g, d) = select2(d > 0.0, 0.0, g(d));\n"
     "  is_bent = (c > 0.0) & (k >= s);\n"
     "  straight = select2(k < s, select2(c == 0.0, k, s), s);\n"
     "  low = select2(is_bent, straight, s);\n"
     "  bend = select2(is_bent, 0.0, c);\n"
     "  high = select2(is_bent, straight, k);\n"
     "};\n"},
    {"alone_clipped_contact",
     "alone_clipped_contact(s, c, k, z, t, f, damping, b, speed, way, gamma) =\n"
     "  f + risen(gradient_clipped_contact(s, c, k, z, t, b), damping, way - gamma*f, gamma);\n"},
    {"steady_power_contact",
     "steady_power_contact(k, p, z, t, now, speed, way) = 0.0,\n"
     "  0.5*z*select2(now + t > 0.0, 0.0, pow(max(now + t, 1e-300), max(p, 1.0)));\n"},
    {"gradient_power_contact",
     "gradient_power_contact(k, p, z, t, b) = discrete(energy, force, slope, b + t)\n"
     "with {\n"
     "  n = max(p, 1.0);\n"
     "  deep(d, a) = select2(d > 0.0, 0.0, pow(max(d, 1e-300), a));\n"
     "  energy(d) = k/(n + 1.0)*deep(d, n + 1.0);\n"
     "  force(d) = k*deep(d, n);\n"
     "  slope(d) = k*n*deep(d, n - 1.0);\n"
     "};\n"},
    {"alone_power_contact",
     "alone_power_contact(k, p, z, t, f, damping, b, speed, way, gamma) =\n"
     "  f + risen(gradient_power_contact(k, p, z, t, b), damping, way - gamma*f, gamma);\n"},
};

}  // namespace

std::span<const FaustDefinition> faust_passive_definitions() {
  return definitions;
}

}  // namespace ressort::model
