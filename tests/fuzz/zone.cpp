// Any zone, drivers and options: refused, or a run whose temperatures are finite, or one that says it is not.
#include "input.hpp"
#include "zone/Simulation.hpp"

namespace {

using namespace amiss::zone;
using amiss::fuzz::Input;

constexpr int kColumns = 4;

void perhaps_column(Input& in, Column& column) { in.perhaps(column, -2, kColumns); }

Wall make_wall(Input& in) {
  Wall wall;
  wall.layers.resize(static_cast<std::size_t>(in.integer(0, 3)));
  for (Layer& layer : wall.layers) {
    in.perhaps(layer.thickness);
    in.perhaps(layer.conductivity);
    in.perhaps(layer.capacity);
  }
  for (double* field :
       {&wall.area, &wall.inside_convection, &wall.inside_emissivity, &wall.outside_film, &wall.absorptance,
        &wall.outside_emissivity, &wall.sky_view, &wall.azimuth, &wall.wind_film})
    in.perhaps(*field);
  for (Column* column : {&wall.outside, &wall.sun, &wall.sky, &wall.wind_speed, &wall.wind_direction})
    perhaps_column(in, *column);
  return wall;
}

Window make_window(Input& in) {
  Window window;
  window.outside = 0;
  for (double* field : {&window.area, &window.u_value, &window.solar_factor, &window.to_air})
    in.perhaps(*field);
  for (Column* column : {&window.outside, &window.sun}) perhaps_column(in, *column);
  return window;
}

Opening make_opening(Input& in) {
  Opening opening;
  opening.kind = in.flag() ? OpeningKind::crack : OpeningKind::orifice;
  opening.exposure = static_cast<Exposure>(in.integer(0, 2));
  opening.outside = 0;
  opening.wind_speed = in.integer(-1, kColumns - 1);
  opening.wind_direction = 2;
  for (double* field :
       {&opening.area, &opening.width, &opening.length, &opening.height, &opening.azimuth, &opening.shelter})
    in.perhaps(*field);
  for (Column* column : {&opening.outside, &opening.wind_direction}) perhaps_column(in, *column);
  return opening;
}

Zone make_zone(Input& in) {
  Zone zone;
  for (double* field :
       {&zone.volume, &zone.air_capacity_factor, &zone.initial_air, &zone.initial_wall_offset})
    in.perhaps(*field);
  for (int k = in.integer(0, 5); k > 0; --k) zone.walls.push_back(make_wall(in));
  for (int k = in.integer(0, 1); k > 0; --k) zone.windows.push_back(make_window(in));
  for (int k = in.integer(0, 3); k > 0; --k) zone.openings.push_back(make_opening(in));
  if (in.flag()) zone.infiltrations.push_back({"infiltration", in.number(), in.integer(-1, kColumns)});
  if (in.flag()) {
    Heater heater;
    heater.power = in.integer(-1, kColumns);
    for (double* field : {&heater.radiant_fraction, &heater.capacity, &heater.conductance})
      in.perhaps(*field);
    zone.heaters.push_back(heater);
  }
  if (in.flag())
    zone.supplies.push_back({"supply", in.integer(-1, kColumns), in.integer(0, kColumns), in.number()});
  if (in.flag()) zone.couplings.push_back({"coupling", in.number(), in.integer(-1, kColumns)});
  if (in.flag()) zone.gains.push_back({"gain", in.integer(-1, kColumns), in.number(), in.number()});
  return zone;
}

// A run that is long for its fineness alone is none of this fuzzer's business; one that is too fine to be run
// has to be refused.
bool takes_long(const Zone& zone, double step_s, const Options& options) {
  double thickest = 0.0;
  for (const Wall& wall : zone.walls) {
    for (const Layer& layer : wall.layers) thickest = std::max(thickest, layer.thickness);
  }
  const double cells = 3.5 * options.cells * std::sqrt(thickest / std::sqrt(5e-7 * step_s));
  const double steps = step_s / options.max_substep_s;
  return (steps > 20.0 && steps < 1.1e8) || (cells > 100.0 && cells < 1.1e6);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input in(data, size);
  const Zone zone = make_zone(in);
  const Eigen::MatrixXd drivers = in.matrix(in.integer(0, 6), in.integer(kColumns - 1, kColumns));
  Eigen::VectorXd hold(in.flag() ? in.integer(0, 6) : 0);
  for (double& value : hold) value = in.flag() ? in.number() : NAN;
  Options options;
  for (double* field : {&options.max_substep_s, &options.cells, &options.initial_hours}) in.perhaps(*field);
  in.perhaps(options.spinup, -1, 2);
  double step_s = 900.0;
  in.perhaps(step_s);
  if (takes_long(zone, step_s, options)) return 0;
  amiss::fuzz::refusable([&] {
    const Run run = simulate(zone, drivers, step_s, hold, options);
    amiss::fuzz::require(run.air.size() == drivers.rows(), "one temperature for each interval");
    amiss::fuzz::require(run.ok ? run.air.allFinite() : run.air.array().isNaN().all(),
                         "finite, or said not to be");
  });
  return 0;
}
