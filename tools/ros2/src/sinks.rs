//! Targets of data: a folder of images, or a UDP receiver.

use anyhow::{Context, ensure};
use files::atomic_file::AtomicFile;
use std::io::Write;
use std::net::{SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};

/// Largest content of a UDP packet, bytes.
const MAX_DATAGRAM: usize = 65_507;

/// A target of data.
pub enum Sink {
    Folder(PathBuf),
    Udp(Udp),
}

/// A receiver of lines or packets.
pub struct Udp {
    socket: UdpSocket,
    to: SocketAddr,
    /// End of a line.
    end: &'static str,
}

impl Sink {
    pub fn folder(path: PathBuf) -> anyhow::Result<Self> {
        std::fs::create_dir_all(&path).with_context(|| path.display().to_string())?;
        Ok(Self::Folder(path))
    }

    pub fn udp(to: SocketAddr, end: &'static str) -> anyhow::Result<Self> {
        let socket = UdpSocket::bind("0.0.0.0:0").context("cannot open a UDP socket")?;
        Ok(Self::Udp(Udp { socket, to, end }))
    }
}

impl Udp {
    pub fn send_line(&self, line: &str) -> anyhow::Result<()> {
        self.send(format!("{line}{}", self.end).as_bytes())
    }

    pub fn send(&self, packet: &[u8]) -> anyhow::Result<()> {
        ensure!(packet.len() <= MAX_DATAGRAM, "a packet of {} bytes; must be at most {MAX_DATAGRAM}", packet.len());
        self.socket.send_to(packet, self.to).with_context(|| self.to.to_string()).map(drop)
    }
}

/// Writes an image as grabbers do: it becomes visible to other programs when it is complete.
pub fn write_image(folder: &Path, stamp: i64, extension: &str, content: &[u8]) -> anyhow::Result<()> {
    let path = folder.join(format!("{stamp}.{extension}"));
    let file = AtomicFile::create(&path).with_context(|| path.display().to_string())?;
    file.file().write_all(content).with_context(|| path.display().to_string())?;
    file.commit_unsynced().with_context(|| path.display().to_string())
}
