//! Data of the auxiliary sensors of a drive: images, NMEA sentences and IMU samples, in time order.

use super::Sent;
use super::images::ImageWriter;
use super::lines::{LineKind, Lines};
use anyhow::Context;
use drive::{Drive, Frame};
use geometry::Stamp;
use std::net::{SocketAddr, UdpSocket};
use std::path::PathBuf;

/// Targets of the measurements; `None`: not sent.
#[derive(Clone, Debug, Default)]
pub(super) struct Targets {
    pub(super) images: Option<PathBuf>,
    pub(super) nmea: Option<SocketAddr>,
    pub(super) imu: Option<SocketAddr>,
}

/// The sensors that are sent, each at its next measurement.
pub(super) struct AuxiliarySensors<'a> {
    targets: &'a Targets,
    /// Images with the folders of their cameras.
    frames: Vec<(&'a Frame, &'a str)>,
    next_frame: usize,
    nmea: Option<Lines>,
    imu: Option<Lines>,
}

/// The measurement that is due.
#[derive(Clone, Copy)]
enum Due {
    Frame,
    Nmea,
    Imu,
}

impl<'a> AuxiliarySensors<'a> {
    /// All measurements of the drive; empty without a drive.
    pub(super) fn from_drive(drive: Option<&'a Drive>, targets: &'a Targets) -> anyhow::Result<Self> {
        let mut others = Self { targets, frames: Vec::new(), next_frame: 0, nmea: None, imu: None };
        let Some(drive) = drive else { return Ok(others) };
        let manifest = drive.manifest();
        if targets.images.is_some() {
            let color = drive.camera_frames().iter();
            let color = color.filter_map(|frame| Some((frame, manifest.cameras.get(frame.camera)?.folder.as_str())));
            let mosaics = drive.mosaic_frames().iter();
            let mosaics =
                mosaics.filter_map(|frame| Some((frame, manifest.mosaics.get(frame.camera)?.folder.as_str())));
            others.frames = color.chain(mosaics).collect();
            others.frames.sort_by_key(|(frame, _)| frame.stamp);
        }
        let open = |file: &String, kind| Lines::open(&drive.folder().join(file), kind);
        if let Some(entry) = manifest.gnss.as_ref().filter(|_| targets.nmea.is_some()) {
            others.nmea = Some(open(&entry.file, LineKind::Nmea)?);
        }
        if let Some(entry) = manifest.imu.as_ref().filter(|_| targets.imu.is_some()) {
            others.imu = Some(open(&entry.file, LineKind::Imu)?);
        }
        Ok(others)
    }

    /// Skips measurements before a time.
    pub(super) fn skip_before(&mut self, begin: Stamp) -> anyhow::Result<()> {
        while let Some((_, due)) = self.next().filter(|(at, _)| *at < begin) {
            self.advance(due)?;
        }
        Ok(())
    }

    /// Time of the next measurement.
    pub(super) fn next_stamp(&self) -> Option<Stamp> {
        self.next().map(|(at, _)| at)
    }

    /// Sends the next measurement, with its stamp moved by `shift` ns.
    pub(super) fn send_next(
        &mut self,
        shift: i64,
        socket: &UdpSocket,
        images: &mut ImageWriter,
        sent: &mut Sent,
    ) -> anyhow::Result<()> {
        let Some((_, due)) = self.next() else { return Ok(()) };
        let send = |lines: &Option<Lines>, target: Option<SocketAddr>| -> anyhow::Result<u64> {
            let Some((target, line)) = target.zip(lines.as_ref().and_then(|lines| lines.moved(shift))) else {
                return Ok(0);
            };
            socket.send_to(line.as_bytes(), target).with_context(|| format!("cannot send to {target}"))?;
            Ok(1)
        };
        match due {
            Due::Frame => {
                let (frame, folder) = self.frames[self.next_frame];
                if let Some(root) = &self.targets.images {
                    images.write(frame, &root.join(folder), shift)?;
                    sent.n_images += 1;
                }
            }
            Due::Nmea => sent.n_nmea += send(&self.nmea, self.targets.nmea)?,
            Due::Imu => sent.n_imu += send(&self.imu, self.targets.imu)?,
        }
        self.advance(due)
    }

    fn next(&self) -> Option<(Stamp, Due)> {
        let of_lines = |lines: &Option<Lines>| lines.as_ref().and_then(Lines::next_stamp);
        let frame = self.frames.get(self.next_frame).map(|(frame, _)| (frame.stamp, Due::Frame));
        let nmea = of_lines(&self.nmea).map(|at| (at, Due::Nmea));
        let imu = of_lines(&self.imu).map(|at| (at, Due::Imu));
        [frame, nmea, imu].into_iter().flatten().min_by_key(|(at, _)| *at)
    }

    fn advance(&mut self, due: Due) -> anyhow::Result<()> {
        match due {
            Due::Frame => {
                self.next_frame += 1;
                Ok(())
            }
            Due::Nmea => self.nmea.as_mut().map_or(Ok(()), Lines::advance),
            Due::Imu => self.imu.as_mut().map_or(Ok(()), Lines::advance),
        }
    }
}
