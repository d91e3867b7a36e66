//! The topics that can be replayed: all topics of this project.

use messages::{
    ClassTopic, ColorTopic, CubeTopic, GnssTopic, ImageTopic, ImuTopic, InstanceTopic, MaterialTopic, Message,
    MosaicTopic, PlacementTopic, SpectraTopic, SubmapTopic, SweepTopic, TrajectoryTopic,
};
use stage::{Outputs, Port, Received, StepError};
use std::sync::LazyLock;

/// How a topic is published from bytes.
pub struct Replayed {
    /// Its name.
    pub topic: &'static str,
    /// [`Message::VERSION`].
    pub version: u32,
    /// [`Message::LAYOUT`].
    pub layout: u64,
    /// As an output.
    pub port: Port,
    /// Publishes a recorded message.
    pub publish: fn(&mut Outputs, &[u8]) -> Result<(), StepError>,
}

/// All topics.
pub static TOPICS: LazyLock<Vec<Replayed>> = LazyLock::new(|| {
    vec![
        of::<SweepTopic>(),
        of::<ImageTopic>(),
        of::<MosaicTopic>(),
        of::<GnssTopic>(),
        of::<ImuTopic>(),
        of::<CubeTopic>(),
        of::<SubmapTopic>(),
        of::<TrajectoryTopic>(),
        of::<PlacementTopic>(),
        of::<ColorTopic>(),
        of::<SpectraTopic>(),
        of::<MaterialTopic>(),
        of::<ClassTopic>(),
        of::<InstanceTopic>(),
    ]
});

fn of<T: Message>() -> Replayed {
    Replayed { topic: T::TOPIC, version: T::VERSION, layout: T::LAYOUT, port: Port::of::<T>(), publish: publish::<T> }
}

fn publish<T: Message>(outputs: &mut Outputs, bytes: &[u8]) -> Result<(), StepError> {
    let message = Received::<T>::from_bytes(bytes)?;
    let mut loan = outputs.loan::<T>(message.rows().len())?;
    *loan.header_mut() = *message.header();
    loan.extend_from_slice(message.rows())?;
    outputs.publish(loan, message.stamp())
}
