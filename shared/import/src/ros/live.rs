//! Messages of a running ROS 2, one at a time: the files, lines and packets that a live run receives.

use super::bag::Encoding;
use super::cursor::Cursor;
use super::gnss::fix_lines;
use super::images::{compressed_extension, pgm, png};
use super::imu::ImuLines;
use super::messages::{CompressedImage, Header, Image, Imu, NavSatFix, sentence};
use super::packets::PacketsKind;
use std::borrow::Cow;

/// IMU samples from which the unit is determined. They wait for each other: fewer samples give the first line earlier. No
/// vehicle measures a total acceleration, gravity included, of 0.5 to 2 m/s^2 in several samples.
const EXAMINED: usize = 10;
/// Maximum length of a line, bytes: a live run does not read longer lines.
const MAX_LINE: usize = 1024;

/// Data of a message for a live run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LiveData<'a> {
    /// An image as a file.
    Image {
        /// ns since the Unix epoch.
        stamp: i64,
        /// `jpg`, `png` or `pgm`.
        extension: &'static str,
        /// Content of the file.
        content: Cow<'a, [u8]>,
    },
    /// Lines without their ends: samples of an IMU as in `imu.csv`, or NMEA sentences.
    Lines(Vec<String>),
    /// Packets of a LiDAR.
    Packets(Vec<&'a [u8]>),
}

/// Kinds of messages that a live run accepts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Image,
    CompressedImage,
    Imu,
    Fix,
    Sentence,
    Packets(PacketsKind),
}

/// Data that a live run can receive from a type of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LiveSensor {
    /// Images of a camera.
    Camera,
    /// Samples of an IMU.
    Imu,
    /// Positions of a GNSS receiver.
    Fixes,
    /// NMEA sentences of a GNSS receiver.
    Sentences,
    /// Packets of a LiDAR.
    Packets,
    /// Clouds of a LiDAR, which a live run does not accept.
    Clouds,
}

impl LiveSensor {
    /// The sensor of a type (`sensor_msgs/Image`); `None` for other types.
    pub fn from_type(name: &str) -> Option<Self> {
        let sensor = match Kind::from_type(name) {
            Some(Kind::Image | Kind::CompressedImage) => Self::Camera,
            Some(Kind::Imu) => Self::Imu,
            Some(Kind::Fix) => Self::Fixes,
            Some(Kind::Sentence) => Self::Sentences,
            Some(Kind::Packets(_)) => Self::Packets,
            None if super::roles::CLOUDS.contains(&name) => Self::Clouds,
            None => return None,
        };
        Some(sensor)
    }
}

impl Kind {
    fn from_type(name: &str) -> Option<Self> {
        match name {
            "sensor_msgs/Image" => Some(Self::Image),
            "sensor_msgs/CompressedImage" => Some(Self::CompressedImage),
            "sensor_msgs/Imu" => Some(Self::Imu),
            "sensor_msgs/NavSatFix" => Some(Self::Fix),
            "nmea_msgs/Sentence" => Some(Self::Sentence),
            _ => PacketsKind::from_type(name).map(Self::Packets),
        }
    }
}

/// Reads the messages of one topic.
pub struct LiveTopic {
    kind: Kind,
    /// Whether raw images come from a mosaic camera.
    is_mosaic: bool,
    imu: ImuLines,
    /// Stamp of the last image.
    last_image: Option<i64>,
    /// Messages without stamp, for which the time of reception is used.
    pub n_unstamped: u64,
}

impl LiveTopic {
    /// Reads messages of a type (`sensor_msgs/Image`); `None` if a live run does not accept them. Images of a mosaic
    /// camera keep their samples unchanged, as PGM.
    pub fn new(type_name: &str, is_mosaic: bool) -> Option<Self> {
        let kind = Kind::from_type(type_name)?;
        Some(Self { kind, is_mosaic, imu: ImuLines::new(EXAMINED), last_image: None, n_unstamped: 0 })
    }

    /// The data of a message in CDR with its encapsulation, received at this time (ns since the Unix epoch). An error
    /// contains the reason why the message is left out; later messages are not affected.
    pub fn read<'a>(&mut self, message: &'a [u8], received: i64) -> Result<LiveData<'a>, String> {
        let fault = |fault: super::cursor::MessageFault| fault.to_string();
        let c = &mut Cursor::new(Encoding::Cdr, message).map_err(fault)?;
        match self.kind {
            Kind::Image => {
                let image = Image::read(c).map_err(fault)?;
                let (extension, content) = if self.is_mosaic { ("pgm", pgm(&image)?) } else { ("png", png(&image)?) };
                let stamp = self.image_stamp(&image.header, received)?;
                Ok(LiveData::Image { stamp, extension, content: content.into() })
            }
            Kind::CompressedImage if self.is_mosaic => {
                Err("a compressed image has lost the samples of a mosaic camera; take its sensor_msgs/Image".into())
            }
            Kind::CompressedImage => {
                let image = CompressedImage::read(c).map_err(fault)?;
                let extension = compressed_extension(&image)?;
                let stamp = self.image_stamp(&image.header, received)?;
                Ok(LiveData::Image { stamp, extension, content: image.data.into() })
            }
            Kind::Imu => {
                let imu = Imu::read(c).map_err(fault)?;
                let stamp = self.stamp(&imu.header, received);
                self.imu.add(stamp, &imu).map(LiveData::Lines).map_err(|left_out| left_out.to_string())
            }
            Kind::Fix => {
                let fix = NavSatFix::read(c).map_err(fault)?;
                let (lines, _) = fix_lines(self.stamp(&fix.header, received), &fix)?;
                Ok(LiveData::Lines(lines))
            }
            Kind::Sentence => {
                let text = sentence(c).map_err(fault)?;
                let lines: Vec<_> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
                if let Some(line) = lines.iter().find(|line| line.len() > MAX_LINE) {
                    return Err(format!("a sentence of {} bytes; must be at most {MAX_LINE}", line.len()));
                }
                Ok(LiveData::Lines(lines.into_iter().map(str::to_owned).collect()))
            }
            Kind::Packets(kind) => {
                let packets = kind.read(c, received).map_err(fault)?.packets;
                Ok(LiveData::Packets(packets.into_iter().map(|(_, packet)| packet).collect()))
            }
        }
    }

    /// The stamp of an image, which names its file.
    fn image_stamp(&mut self, header: &Header, received: i64) -> Result<i64, String> {
        let stamp = self.stamp(header, received);
        if self.last_image.replace(stamp) == Some(stamp) {
            return Err("its stamp equals the stamp of the previous image".into());
        }
        Ok(stamp)
    }

    /// The stamp of a message, or the time of its reception.
    fn stamp(&mut self, header: &Header, received: i64) -> i64 {
        if header.stamp == 0 {
            self.n_unstamped += 1;
            return received;
        }
        header.stamp
    }
}

#[cfg(test)]
mod tests;
