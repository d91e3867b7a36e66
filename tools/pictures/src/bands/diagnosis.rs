//! Diagnosis of the reflectances of an input.

use super::channel::{Channel, DenseInterval};
use super::source::Source;

/// Width of the interval in which concentrated channels lie (thesis 4.3.1: "concentrated between 0.1 and 0.2").
const NARROW: f64 = 0.1;
/// With this share of a channel's values in the interval, spectra are too similar to distinguish materials. The thesis has up
/// to 0.94.
const CONCENTRATED: f64 = 0.8;
/// Values this close to the largest one are at the end of the channel. If the end has this share of the values, and this many
/// times the values of the interval before, the channel is clipped.
const END: f64 = 0.01;
const CUT_SHARE: f64 = 0.005;
const CUT_CONTRAST: f64 = 4.0;
/// A larger share of saturated raw samples cannot be caused by glints alone.
const SATURATED: f64 = 0.005;
/// The darkest of many thousand outdoor pixels reflect less. A channel that starts above contains the signal of the sensor
/// itself.
const BLACK: f64 = 0.05;

/// One line per finding; never empty.
pub fn diagnose(source: &Source) -> Vec<String> {
    let mut findings = Vec::new();
    if let Some(raw) = source.raw {
        let rate = |n: u64| n as f64 / raw.n_samples.max(1) as f64;
        let saturated = rate(raw.counts.saturated);
        if saturated >= SATURATED {
            findings
                .push(format!("over-saturated: {:.1} % of the raw samples have the largest value", saturated * 100.0));
        }
        if rate(raw.counts.dead) >= SATURATED {
            findings.push(format!("{:.1} % of the pixels have no usable reference", rate(raw.counts.dead) * 100.0));
        }
    }
    let channels: Vec<&Channel> = source.channels.iter().filter(|channel| channel.n() > 0).collect();
    let n_empty = source.channels.len() - channels.len();
    if n_empty > 0 {
        findings.push(format!("{n_empty} channels have no valid value"));
    }
    findings.extend(about(&channels, "clipped", |channel| {
        let max = channel.max()?;
        let end = channel.share(max - END, f64::INFINITY);
        let before = channel.share(max - 2.0 * END, max - END);
        (end >= CUT_SHARE && end > CUT_CONTRAST * before).then(|| (end, format!("at {max:.2}")))
    }));
    findings.extend(about(&channels, "concentrated", |channel| {
        let DenseInterval { low, share } = channel.densest(NARROW);
        (share >= CONCENTRATED).then(|| (share, format!("between {low:.2} and {:.2}", low + NARROW)))
    }));
    findings.extend(about(&channels, "dark reference missing or too weak", |channel| {
        let darkest = channel.min().filter(|min| *min > BLACK)?;
        Some((1.0, format!("from {darkest:.2} up")))
    }));
    if findings.is_empty() {
        findings.push("no problem found".to_owned());
    }
    findings
}

/// One line for all channels with a finding: their number, and the one with the largest share.
fn about(channels: &[&Channel], what: &str, find: impl Fn(&Channel) -> Option<(f64, String)>) -> Option<String> {
    let found: Vec<(f32, f64, String)> = channels
        .iter()
        .filter_map(|channel| find(channel).map(|(share, place)| (channel.wavelength_nm, share, place)))
        .collect();
    let (nm, share, place) = found.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let n = found.len();
    let of = channels.len();
    let percent = share * 100.0;
    Some(format!("{what}: {n} of {of} channels, most at {nm:.0} nm with {percent:.1} % of its values {place}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One channel of 10 000 values.
    fn diagnosis(value: impl Fn(usize) -> f32) -> String {
        let mut channel = Channel::new(600.0);
        for i in 0..10_000 {
            channel.add(value(i));
        }
        let source = Source { name: "test".into(), channels: vec![channel], raw: None, region: None };
        diagnose(&source).join("; ")
    }

    #[test]
    fn each_fault_is_found_and_good_data_has_none() {
        let spread = |i: usize| (i % 1000) as f32 / 1000.0;
        assert_eq!(diagnosis(spread), "no problem found");
        let clipped = diagnosis(|i| spread(i).min(0.5));
        assert!(
            clipped.contains("clipped: 1 of 1 channels, most at 600 nm") && clipped.contains("at 0.50"),
            "{clipped}"
        );
        let concentrated = diagnosis(|i| if i % 10 == 0 { spread(i / 10) } else { 0.1 + 0.09 * spread(i) });
        assert!(
            concentrated.starts_with("concentrated: 1 of 1") && !concentrated.contains("clipped"),
            "{concentrated}"
        );
        let no_dark = diagnosis(|i| 0.2 + 0.5 * spread(i));
        assert!(no_dark.starts_with("dark reference missing") && no_dark.contains("0.20 up"), "{no_dark}");
    }
}
