//! Values that lie too close together, pulled apart (thesis 4.3.1). They are no reflectances any more.

use super::channel::Channel;

/// Which interval of a channel's values becomes 0..1; values outside are clipped to it.
#[derive(Clone, Copy, Debug)]
pub enum Clip {
    /// "Clip by threshold": from the smallest value to this one, if that is below the largest.
    UpTo(f64),
    /// "Clip by percentage": so many per cent of the values, those that are closest to the channel's mean.
    AroundMean(f64),
}

impl Clip {
    /// What is done.
    pub fn words(self) -> String {
        match self {
            Clip::UpTo(threshold) => format!("clipped at {threshold}"),
            Clip::AroundMean(percent) => {
                format!("clipped by channel to the {percent} % of pixels closest to the mean")
            }
        }
    }

    /// A channel and other values of it (its region's), stretched alike.
    pub fn stretched(self, channel: &Channel, values: &[f32]) -> (Channel, Vec<f64>) {
        let (Some(min), Some(max)) = (channel.min(), channel.max()) else {
            return (channel.clone(), Vec::new());
        };
        let [low, high] = match self {
            Clip::UpTo(threshold) => [min, threshold.min(max)],
            Clip::AroundMean(percent) => channel.around_mean(percent / 100.0),
        };
        // A channel of one value stays in the middle.
        let stretch = |value: f64| if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 };
        (channel.mapped(stretch), values.iter().map(|value| stretch(f64::from(*value))).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clipped_channels_fill_0_to_1_as_the_thesis_says() {
        let values = [0.0, 0.1, 0.1, 0.2, 0.6];
        let mut channel = Channel::new(500.0);
        for value in values {
            channel.add(value);
        }
        let (clipped, same) = Clip::UpTo(0.2).stretched(&channel, &values);
        assert!((clipped.share(0.49, 0.51) - 0.4).abs() < 1e-9, "0.1 is in the middle of 0 to 0.2");
        assert!((clipped.share(0.99, 1.01) - 0.4).abs() < 1e-9, "0.2 and 0.6 are at the end");
        let expected = [0.0, 0.5, 0.5, 1.0, 1.0];
        assert!(same.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-6), "{same:?}");
        // The mean is 0.2; its closest four values are 0 to 0.2, and 0.6 is clipped.
        let (clipped, _) = Clip::AroundMean(80.0).stretched(&channel, &[]);
        assert!((clipped.share(0.99, 1.01) - 0.4).abs() < 1e-9 && clipped.share(-0.01, 0.01) == 0.2);
    }
}
