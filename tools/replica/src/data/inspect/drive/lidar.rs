//! The LiDAR: packets or clouds, a handful of sweeps, and what they cover.

use super::DriveReport;
use super::packets::{PacketSurvey, survey};
use super::pictures;
use super::stream::{Stream, seconds_between};
use drive::{Drive, SourcePosition, SweepSource};
use files::calendar::text_of_nanos;
use geometry::Stamp;
use lidar::nmea::{Fix, LogStats};
use lidar::{ClockReference, SweepError, SweepInfo, SweepPoint};
use std::collections::BTreeMap;

/// Sweeps that are decoded, unless all are.
const QUICK_SWEEPS: usize = 12;
/// A shorter time without packets is the jitter of the capturing machine, ns.
const MIN_PACKET_GAP_NANOS: i64 = 50_000_000;
/// Sweeps of which ranges are kept.
const MAX_RANGE_SWEEPS: usize = 256;
/// Directions around the LiDAR that are distinguished.
const N_SECTORS: usize = 36;
/// A sweep with fewer returns is reported as a doubt.
const FEW_RETURNS: usize = 500;
/// Largest share of missing time in the unread part without a doubt.
const MAX_MISSING_SHARE: f64 = 0.02;
/// Packets that arrive in another order have a smaller step back, ns.
const MAX_STEP_BACK_NANOS: i64 = 2_000_000_000;

/// Facts about the LiDAR that other parts of the report need.
pub struct LidarSurvey {
    /// Fixes and sentences of position packets.
    pub fixes: Vec<Fix>,
    pub log: LogStats,
    /// Packets by the reference of the LiDAR's clock that they report.
    pub clock_references: BTreeMap<ClockReference, u64>,
    /// LiDAR time minus capture time, s.
    pub ahead_of_capture_s: Option<f64>,
    /// Capture time minus GNSS time of the position packets, s.
    pub capture_ahead_of_gnss_s: Option<f64>,
}

/// Sweeps that were decoded.
struct Samples {
    sweeps: Vec<SweepInfo>,
    n_by_ring: Vec<u64>,
    n_by_sector: [u64; N_SECTORS],
    ranges: Vec<f32>,
    /// The points of the sweep with most returns among the first ones.
    shown: Vec<SweepPoint>,
}

impl Samples {
    fn new() -> Self {
        Self {
            sweeps: Vec::new(),
            n_by_ring: vec![0; 256],
            n_by_sector: [0; N_SECTORS],
            ranges: Vec::new(),
            shown: Vec::new(),
        }
    }

    fn add(&mut self, sweep: SweepInfo, points: Vec<SweepPoint>) {
        for point in &points {
            self.n_by_ring[usize::from(point.ring)] += 1;
            let sector = usize::from(point.azimuth) * N_SECTORS / 36_000;
            self.n_by_sector[sector.min(N_SECTORS - 1)] += 1;
        }
        // Enough for a median, whatever the sensor sends.
        if self.sweeps.len() < MAX_RANGE_SWEEPS {
            let step = points.len().div_ceil(4096).max(1);
            let range = |p: &SweepPoint| (p.x * p.x + p.y * p.y + p.z * p.z).sqrt();
            self.ranges.extend(points.iter().step_by(step).map(range).filter(|range_m| range_m.is_finite()));
        }
        if self.sweeps.len() < QUICK_SWEEPS && points.len() > self.shown.len() {
            self.shown = points;
        }
        self.sweeps.push(sweep);
    }

    /// The whole sweeps; all, if none is whole.
    fn whole(&self) -> Vec<&SweepInfo> {
        let whole: Vec<&SweepInfo> = self.sweeps.iter().filter(|sweep| sweep.turn > 0.9).collect();
        if whole.is_empty() { self.sweeps.iter().collect() } else { whole }
    }
}

/// Adds streams, facts, doubts and the first picture.
pub fn add(drive: &Drive, is_full: bool, report: &mut DriveReport) -> anyhow::Result<LidarSurvey> {
    let is_capture = drive.manifest().lidar.format == "pcap";
    let packets = if is_capture { Some(survey(drive, is_full)?) } else { None };
    let mut samples = Samples::new();
    match drive.sweeps() {
        Ok(mut source) => {
            if let Err(error) = decode(drive, &mut source, is_full, &mut samples) {
                report.doubt(error.to_string());
            }
            let damage = source.damage().iter().filter(|text| !report.doubts.contains(text)).cloned();
            let damage: Vec<String> = damage.collect();
            report.doubts.extend(damage);
            add_counters(&source, report);
        }
        // A drive with the wrong model was reported.
        Err(error) if report.doubts.contains(&error.to_string()) => {}
        Err(error) => report.doubt(error.to_string()),
    }
    let mut durations: Vec<u32> = samples.whole().iter().map(|sweep| sweep.duration_nanos).collect();
    durations.sort_unstable();
    let sweep_s = durations.get(durations.len() / 2).map(|nanos| f64::from(*nanos) * 1e-9);
    let ahead_of_capture_s = add_streams(drive, is_full, packets.as_ref(), &samples, report);
    let mut n_returns: Vec<u64> = samples.whole().iter().map(|sweep| sweep.n_returns as u64).collect();
    n_returns.sort_unstable();
    let known = if is_full { Some(samples.sweeps.len()) } else { (!is_capture).then(|| drive.sweep_files().len()) };
    let span_s = report.lidar_span().map_or(0.0, |[first, last]| seconds_between(last, first));
    let estimate = || sweep_s.filter(|sweep_s| *sweep_s > 0.0).map_or(0, |sweep_s| (span_s / sweep_s).round() as u64);
    let n_sweeps = known.map_or_else(estimate, |n| n as u64);
    add_coverage(drive, &samples, &n_returns, report);
    let about = if known.is_some() { "" } else { "about " };
    if let (Some(section), Some(sweep_s)) = (report.sections.last_mut().filter(|s| s.heading == "LiDAR"), sweep_s) {
        section.lines.insert(0, format!("sweeps: {about}{n_sweeps}, {:.2} per second", 1.0 / sweep_s));
    }
    if !samples.shown.is_empty() {
        report.pictures.extend(pictures::top_view(&samples.shown, &drive.rig().body_from_lidar));
    }
    let packets = packets.unwrap_or_default();
    Ok(LidarSurvey {
        fixes: packets.fixes,
        log: packets.log,
        clock_references: packets.clock_references,
        ahead_of_capture_s,
        capture_ahead_of_gnss_s: packets.capture_ahead_s,
    })
}

/// Decodes the first sweeps of captures, sweeps all over the drive of clouds, or all.
fn decode(drive: &Drive, source: &mut SweepSource, is_full: bool, samples: &mut Samples) -> Result<(), SweepError> {
    let mut take = |source: &mut SweepSource| {
        let mut points = Vec::new();
        let next = source.next_sweep(|some| points.extend_from_slice(some))?;
        Ok::<_, SweepError>(next.map(|sweep| samples.add(sweep, points)).is_some())
    };
    let n_files = drive.sweep_files().len();
    if is_full {
        while take(source)? {}
    } else if drive.manifest().lidar.format == "pcap" {
        for _ in 0..QUICK_SWEEPS {
            if !take(source)? {
                break;
            }
        }
    } else {
        for k in 0..QUICK_SWEEPS.min(n_files) {
            let next = (k * n_files / QUICK_SWEEPS.min(n_files)) as u64;
            source.resume(SourcePosition::Clouds { next, taken: 0, n_bad: source.n_bad_clouds() })?;
            take(source)?;
        }
    }
    Ok(())
}

/// Adds the stream of packets or clouds. Returns LiDAR time minus capture time, s.
fn add_streams(
    drive: &Drive,
    is_full: bool,
    packets: Option<&PacketSurvey>,
    samples: &Samples,
    report: &mut DriveReport,
) -> Option<f64> {
    let model = drive.model().title();
    let files = drive.sweep_files();
    let Some(packets) = packets else {
        let n_bytes = files.iter().map(|file| file.metadata().map_or(0, |metadata| metadata.len())).sum();
        let stamps = drive.sweep_stamps().iter().map(|stamp| stamp.0).collect();
        let kind = format!("{model}, {}", drive.manifest().lidar.format);
        report
            .streams
            .push(Stream::new("lidar sweeps", kind, stamps).with_files(files.len(), n_bytes).into_reference());
        return None;
    };
    report
        .doubts
        .extend(packets.damage.iter().filter(|text| !report.doubts.contains(text)).cloned().collect::<Vec<_>>());
    // Other sensors have the time of the LiDAR, not of the capturing machine.
    let first = samples.sweeps.first().map(|sweep| sweep.stamp.0);
    let shift = first.zip(packets.stamps.first()).map(|(lidar, captured)| lidar.saturating_sub(*captured));
    let shifted = |stamp: &i64| stamp.saturating_add(shift.unwrap_or(0));
    let stream = Stream::new("lidar packets", model, packets.stamps.iter().map(shifted).collect())
        .with_files(files.len(), packets.n_bytes)
        .with_min_gap(MIN_PACKET_GAP_NANOS)
        .with_end(packets.end.as_ref().map(shifted))
        .into_reference();
    if packets.n_foreign > 0 {
        let lines = vec![format!("packets that are not data of this LiDAR: {}", packets.n_foreign)];
        report.section("Captures", lines);
    }
    add_unread(packets, report);
    add_set_back(&packets.stamps, report);
    if packets.stamps.is_empty() {
        report.doubt(format!("no data packet of {} in the captures", drive.model().name()));
    }
    report.streams.push(stream);
    if is_full {
        let stamps = samples.sweeps.iter().map(|sweep| sweep.stamp.0).collect();
        report.streams.push(Stream::new("lidar sweeps", model, stamps));
    }
    shift.map(|nanos| nanos as f64 * 1e-9)
}

/// Adds a doubt if the clock of the recorder was set back.
fn add_set_back(captured: &[i64], report: &mut DriveReport) {
    let steps: Vec<&[i64]> =
        captured.windows(2).filter(|pair| pair[0].saturating_sub(pair[1]) > MAX_STEP_BACK_NANOS).collect();
    if let Some(first) = steps.first() {
        report.doubt(format!(
            "lidar: the clock of the recorder steps back {} time(s), first by {:.1} s after {}: process each part in a folder of \
             its own",
            steps.len(),
            first[0].saturating_sub(first[1]) as f64 * 1e-9,
            text_of_nanos(first[0])
        ));
    }
}

/// Compares size and time of the part that was not read.
fn add_unread(packets: &PacketSurvey, report: &mut DriveReport) {
    let (Some(first), Some(last)) = (packets.stamps.first(), packets.stamps.last()) else { return };
    if packets.n_bytes_unread == 0 {
        return;
    }
    let Some(end) = packets.end else {
        report.doubt("the end of the last capture is damaged: its time is unknown; --full reads up to the damage");
        return;
    };
    let read_s = last.saturating_sub(*first) as f64 * 1e-9;
    let n_bytes_read = (packets.n_bytes - packets.n_bytes_unread) as f64;
    let expected_s = packets.n_bytes_unread as f64 / n_bytes_read.max(1.0) * read_s;
    let unread_s = end.saturating_sub(*last) as f64 * 1e-9;
    let missing_s = unread_s - expected_s;
    if missing_s > (MAX_MISSING_SHARE * unread_s).max(1.0) {
        report.doubt(format!(
            "lidar: by the size of the captures, about {missing_s:.0} s of packets are missing in the {unread_s:.0} s that were \
             not read; --full finds them"
        ));
    }
}

/// Adds what the decoder of packets counted.
fn add_counters(source: &SweepSource, report: &mut DriveReport) {
    let stats = source.lidar_stats();
    let usual = ["data_packets", "position_packets"];
    let counts = stats.counts().into_iter().filter(|(name, n)| *n > 0 && !usual.contains(name));
    let counts: Vec<String> = counts.map(|(name, n)| format!("{name} {n}")).collect();
    if stats.has_lost_data() {
        report.doubt(format!("lidar: data is lost in the decoded sweeps: {}", counts.join(", ")));
    }
    if stats.recorder_jumps > 0 {
        report.doubt(format!(
            "clocks: the clock of the recorder jumps {} time(s), by up to {:.1} s, while the clock of the LiDAR goes on",
            stats.recorder_jumps,
            stats.recorder_jump_ms as f64 / 1000.0
        ));
    }
    if stats.source_changes > 0 {
        report.doubt(format!(
            "lidar: silent for {:.1} s, then sent from another port, {} time(s)",
            stats.source_silent_ms as f64 / 1000.0,
            stats.source_changes
        ));
    }
    if stats.second_source_packets > 0 {
        let n = stats.second_source_packets;
        report.doubt(format!(
            "lidar: {n} data packets come from a second port of its address at the same time; not used"
        ));
    }
    let lines =
        if counts.is_empty() { Vec::new() } else { vec![format!("counters of packets: {}", counts.join(", "))] };
    report.section("LiDAR packets", lines);
}

fn add_coverage(drive: &Drive, samples: &Samples, n_returns: &[u64], report: &mut DriveReport) {
    let (Some(least), Some(most)) = (n_returns.first(), n_returns.last()) else {
        report.doubt("lidar: no sweep can be decoded");
        return;
    };
    let mut lines = Vec::new();
    let median = n_returns[n_returns.len() / 2];
    lines.push(format!("decoded sweeps: {}; returns per sweep: {median} ({least} to {most})", samples.sweeps.len()));
    if (median as usize) < FEW_RETURNS {
        report.doubt(format!("lidar: sweeps have only {median} returns"));
    }
    let n_rings = drive.lidar().n_rings();
    let silent: Vec<String> =
        (0..n_rings.min(256)).filter(|ring| samples.n_by_ring[*ring] == 0).map(|ring| ring.to_string()).collect();
    if n_rings > 1 {
        let without = if silent.is_empty() { String::new() } else { format!(": {}", silent.join(" ")) };
        lines.push(format!("rings: {n_rings}; without returns: {}{without}", silent.len()));
        if silent.len() * 2 > n_rings {
            report.doubt(format!("lidar: {} of {n_rings} rings have no returns; check lidar.model", silent.len()));
        }
    }
    let empty: Vec<String> = (0..N_SECTORS)
        .filter(|sector| samples.n_by_sector[*sector] == 0)
        .map(|sector| format!("{}-{}", sector * 10, sector * 10 + 10))
        .collect();
    let empty = if empty.is_empty() { "none".to_owned() } else { empty.join(" ") };
    lines.push(format!("directions without returns (degrees clockwise from x): {empty}"));
    let mut ranges = samples.ranges.clone();
    ranges.sort_by(f32::total_cmp);
    if let (Some(first), Some(last)) = (ranges.first(), ranges.last()) {
        lines.push(format!("ranges: {first:.1} to {last:.1} m, median {:.1} m", ranges[ranges.len() / 2]));
    }
    if samples.sweeps.iter().any(|sweep| !sweep.has_times) {
        lines.push("points have no times".to_owned());
    }
    if let Some([first, last]) = report.lidar_span() {
        lines.insert(0, format!("time: {} to {} UTC, {:.1} s", utc(first), utc(last), seconds_between(last, first)));
    }
    report.section("LiDAR", lines);
}

/// Date and time, UTC.
pub fn utc(stamp: Stamp) -> String {
    use files::calendar::{DAY_NANOS, date_from_days};
    let (year, month, day) = date_from_days(stamp.0.div_euclid(DAY_NANOS));
    let millis = stamp.0.rem_euclid(DAY_NANOS) / 1_000_000;
    let seconds = millis / 1000;
    let millis = millis % 1000;
    let hour = seconds / 3600;
    let minute = seconds / 60 % 60;
    let second = seconds % 60;
    format!("{year}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02}.{millis:03}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_is_written_as_utc() {
        assert_eq!(utc(Stamp(1_700_000_000_123_000_000)), "2023-11-14 22:13:20.123");
        assert_eq!(utc(Stamp(-1_000_000)), "1969-12-31 23:59:59.999");
    }
}
