//! Contrast stretching of channels (thesis section 4.3.1). The results are not reflectances.

use pictures::bands::channel::Channel;

/// The interval of a channel's values that is stretched to 0..1. Values outside are clipped to it.
#[derive(Clone, Copy, Debug)]
pub enum Stretch {
    /// "Clip by threshold": from the smallest value to this one, if that is below the largest.
    UpTo(f64),
    /// "Clip by percentage": this percentage of the values, the closest to the channel's mean.
    AroundMean(f64),
}

/// A stretched channel.
pub struct Stretched {
    pub channel: Channel,
    /// Values of a region of it.
    pub values: Vec<f64>,
}

impl Stretch {
    /// Description of the operation.
    pub fn description(self) -> String {
        match self {
            Stretch::UpTo(threshold) => format!("clipped at {threshold}"),
            Stretch::AroundMean(percent) => {
                format!("clipped by channel to the {percent} % of pixels closest to the mean")
            }
        }
    }

    /// Stretches a channel, and with the same mapping the values of a region of it.
    pub fn apply(self, channel: &Channel, values: &[f32]) -> Stretched {
        let untouched = || Stretched { channel: channel.clone(), values: Vec::new() };
        let Some(min) = channel.min() else { return untouched() };
        let Some(max) = channel.max() else { return untouched() };
        let [low, high] = match self {
            Stretch::UpTo(threshold) => [min, threshold.min(max)],
            Stretch::AroundMean(percent) => channel.around_mean(percent / 100.0),
        };
        // A channel with a single value is mapped to the middle.
        let stretch = |value: f64| if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 };
        let values = values.iter().map(|value| stretch(f64::from(*value))).collect();
        Stretched { channel: channel.mapped(stretch), values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretched_channel_fills_0_to_1() {
        let values = [0.0, 0.1, 0.1, 0.2, 0.6];
        let mut channel = Channel::new(500.0);
        for value in values {
            channel.add(value);
        }
        let Stretched { channel: clipped, values: same } = Stretch::UpTo(0.2).apply(&channel, &values);
        assert!((clipped.share(0.49, 0.51) - 0.4).abs() < 1e-9, "0.1 is in the middle of 0 to 0.2");
        assert!((clipped.share(0.99, 1.01) - 0.4).abs() < 1e-9, "0.2 and 0.6 are at the end");
        let expected = [0.0, 0.5, 0.5, 1.0, 1.0];
        assert_eq!(same.len(), expected.len());
        assert!(same.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-6), "{same:?}");
        // The mean is 0.2; its closest four values are 0 to 0.2, and 0.6 is clipped.
        let clipped = Stretch::AroundMean(80.0).apply(&channel, &[]).channel;
        assert!((clipped.share(0.99, 1.01) - 0.4).abs() < 1e-9 && clipped.share(-0.01, 0.01) == 0.2);
    }
}
