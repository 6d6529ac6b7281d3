// A run's numbers as the report holds them: one array a column, a place in it a frame.
'use strict';

function readRun(json) {
  const columns = json.columns;
  const stamps = new BigInt64Array(bytesOf(columns.time));
  const whole = { ...json, stamps };
  whole.time = Float64Array.from(stamps, (stamp) => Number(stamp - stamps[0]) / 1e9);
  whole.frame = new Uint32Array(bytesOf(columns.frame));
  whole.state = new Uint8Array(bytesOf(columns.state));
  for (const name of ['reason', 'chosen', 'rival']) whole[name] = new Uint8Array(bytesOf(columns[name] || ''));
  for (const name of ['map', 'features', 'still', 'moving']) whole[name] = new Uint16Array(bytesOf(columns[name]));
  whole.pose = floats(columns.pose);
  whole.ms = floats(columns.ms);
  whole.stage = columns.stages.map(floats);
  whole.error = columns.error ? floats(columns.error) : null;
  whole.truth = json.truth ? floats(json.truth) : null;
  whole.truthMap = whole.error ? whole.map[whole.error.findIndex((error) => !Number.isNaN(error))] : 0;
  // A longer silence between two frames is a gap in the path: three frames of those that were kept.
  whole.gap_s = Math.max(0.25, 3 * json.stride * (json.period_ms || 33.3) / 1000);
  return whole;
}

// Seconds with nine places, as they were stamped.
function stampText(stamp) {
  const digits = String(stamp < 0n ? -stamp : stamp).padStart(10, '0');
  return `${stamp < 0n ? '-' : ''}${digits.slice(0, -9)}.${digits.slice(-9)}`;
}

function csvOf(run) {
  const head = ['frame', 'time_s', 'state', 'reason', 'map', 'x_m', 'y_m', 'z_m', 'qx', 'qy', 'qz', 'qw', 'error_m', 'features',
    'static', 'moving', 'chosen_percent', 'rival_percent', 'ms', ...run.stages.map((name) => name.replaceAll(' ', '_') + '_ms')];
  const lines = [head.join(',')];
  const short = (value) => (Number.isNaN(value) ? '' : String(Number(value.toPrecision(7))));
  for (let i = 0; i < run.time.length; ++i) {
    const pose = Array.from({ length: 7 }, (_, k) => (run.state[i] === 0 ? '' : short(run.pose[7 * i + k])));
    lines.push([run.frame[i], stampText(run.stamps[i]), ['none', 'predicted', 'unsure', 'tracked'][run.state[i]],
      run.state[i] === 3 ? '' : run.reasons[run.reason[i]], run.map[i], ...pose, run.error ? short(run.error[i]) : '',
      run.features[i], run.still[i], run.moving[i], run.chosen[i], run.rival[i], short(run.ms[i]), ...run.stage.map((stage) => short(stage[i]))].join(','));
  }
  return lines.join('\n') + '\n';
}
