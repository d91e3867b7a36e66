//! The topics that can be replayed: those of this project.

use messages::{
    Class, Color, Cube, Gnss, Image, Imu, Instance, Message, Mosaic, Placement, Spectra, Submap, Sweep, Trajectory,
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

/// All of them.
pub static TOPICS: LazyLock<Vec<Replayed>> = LazyLock::new(|| {
    vec![
        of::<Sweep>(),
        of::<Image>(),
        of::<Mosaic>(),
        of::<Gnss>(),
        of::<Imu>(),
        of::<Cube>(),
        of::<Submap>(),
        of::<Trajectory>(),
        of::<Placement>(),
        of::<Color>(),
        of::<Spectra>(),
        of::<Class>(),
        of::<Instance>(),
    ]
});

fn of<T: Message>() -> Replayed {
    Replayed { topic: T::TOPIC, version: T::VERSION, layout: T::LAYOUT, port: Port::of::<T>(), publish: publish::<T> }
}

fn publish<T: Message>(outputs: &mut Outputs, bytes: &[u8]) -> Result<(), StepError> {
    let message = Received::<T>::from_bytes(bytes)?;
    let mut loan = outputs.loan::<T>(message.rows().len())?;
    *loan.header_mut() = *message.header();
    loan.extend_from_slice(message.rows()).ok_or_else(|| StepError::data("the loan is too small"))?;
    outputs.publish(loan, message.stamp())
}
