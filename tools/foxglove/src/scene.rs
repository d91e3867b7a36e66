//! The messages of a pipeline as Foxglove messages.
//!
//! | topic | message | frame |
//! |---|---|---|
//! | `/points` | `PointCloud`: a submap with color, class, instance | `odom` |
//! | `/sweep`, `/sweep_1` ... | `PointCloud`: a sweep as measured | `lidar`, `lidar_1` ... |
//! | `/camera_0` ... | `CompressedImage`, JPEG | `camera_0` ... |
//! | `/tf` | `FrameTransforms` from `odom` to `body` and to each lidar | |
//! | `/fix` | `LocationFix` | `body` |
//! | `/objects` | `SceneUpdate`: boxes of instances | `odom` |

use crate::clouds::{pose, submap_cloud, sweep_cloud, timestamp};
use crate::objects::boxes;
use crate::submaps::Submaps;
use anyhow::{Context as _, bail};
use bytes::Bytes;
use foxglove::messages::{CompressedImage, FrameTransform, FrameTransforms, LocationFix, PointCloud, SceneUpdate};
use foxglove::{Channel, ChannelBuilder, Context, Encode};
use image::codecs::jpeg::JpegEncoder;
use messages::pod::rows_from_bytes;
use messages::{
    ByteTable, ClassTopic, ColorTopic, Envelope, GnssRow, GnssTopic, ImageHeader, ImageTopic, InstanceTopic, Message,
    Pod, StampedPose, SubmapHeader, SubmapTopic, SweepHeader, SweepTopic, TrajectoryTopic,
};
use std::collections::BTreeMap;
use std::sync::Arc;

const ODOM: &str = "odom";
/// Quality of JPEG files; at lower quality compression blocks are visible.
const JPEG_QUALITY: u8 = 85;

/// Shows the messages of a pipeline on the channels of a context.
pub struct Scene {
    context: Arc<Context>,
    points: Channel<PointCloud>,
    transforms: Channel<FrameTransforms>,
    fixes: Channel<LocationFix>,
    objects: Channel<SceneUpdate>,
    sweeps: BTreeMap<u32, Channel<PointCloud>>,
    cameras: BTreeMap<u32, Channel<CompressedImage>>,
    submaps: Submaps,
    n_shown: u64,
}

impl Scene {
    /// The topics that are shown.
    pub const TOPICS: [&'static str; 8] = [
        SubmapTopic::TOPIC,
        ColorTopic::TOPIC,
        ClassTopic::TOPIC,
        InstanceTopic::TOPIC,
        SweepTopic::TOPIC,
        ImageTopic::TOPIC,
        TrajectoryTopic::TOPIC,
        GnssTopic::TOPIC,
    ];

    /// A scene that shows up to `most_points` points of a submap.
    pub fn new(context: &Arc<Context>, most_points: usize) -> Self {
        Self {
            points: channel(context, "/points".to_owned()),
            transforms: channel(context, "/tf".to_owned()),
            fixes: channel(context, "/fix".to_owned()),
            objects: channel(context, "/objects".to_owned()),
            sweeps: BTreeMap::new(),
            cameras: BTreeMap::new(),
            submaps: Submaps::new(most_points),
            n_shown: 0,
            context: Arc::clone(context),
        }
    }

    /// Submaps wait for the columns among these topics.
    pub fn expect_columns<'a>(&mut self, topics: impl Iterator<Item = &'a str>) {
        self.submaps.expect(topics);
    }

    /// Number of messages shown so far.
    pub fn n_shown(&self) -> u64 {
        self.n_shown
    }

    /// Shows a message. Messages of other topics are left out; another layout of a shown topic is an error.
    pub fn show(&mut self, table: &ByteTable, envelope: &Envelope, header: &[u8], rows: &[u8]) -> anyhow::Result<()> {
        let stamp = envelope.stamp;
        match table.topic.as_str() {
            SweepTopic::TOPIC => {
                check::<SweepTopic>(table)?;
                let SweepHeader { lidar, .. } = header_of(table, header)?;
                let suffix = lidar_suffix(lidar);
                let shown =
                    self.sweeps.entry(lidar).or_insert_with(|| channel(&self.context, format!("/sweep{suffix}")));
                shown.log_with_time(&sweep_cloud(stamp, &format!("lidar{suffix}"), rows), nanos(stamp));
                self.n_shown += 1;
            }
            ImageTopic::TOPIC => {
                check::<ImageTopic>(table)?;
                let header: ImageHeader = header_of(table, header)?;
                let shown = self.cameras.entry(header.camera);
                let shown = shown.or_insert_with(|| channel(&self.context, format!("/camera_{}", header.camera)));
                // Compression takes a while and is skipped without a client.
                if shown.has_sinks() {
                    shown.log_with_time(&jpeg(stamp, &header, rows)?, nanos(stamp));
                }
                self.n_shown += 1;
            }
            TrajectoryTopic::TOPIC => {
                check::<TrajectoryTopic>(table)?;
                for row in rows_of::<StampedPose>(table, rows)? {
                    let pose = row.odom_from_body.checked().with_context(|| format!("trajectory {}", envelope.seq))?;
                    self.transform(row.stamp, vec![frame(row.stamp, "body".to_owned(), &pose)]);
                }
            }
            GnssTopic::TOPIC => {
                check::<GnssTopic>(table)?;
                for row in rows_of::<GnssRow>(table, rows)?.iter().filter(|row| row.quality != 0) {
                    let fix = LocationFix {
                        timestamp: Some(timestamp(row.stamp)),
                        frame_id: "body".to_owned(),
                        latitude: row.latitude_deg,
                        longitude: row.longitude_deg,
                        altitude: row.altitude_m,
                        ..LocationFix::default()
                    };
                    self.fixes.log_with_time(&fix, nanos(row.stamp));
                    self.n_shown += 1;
                }
            }
            SubmapTopic::TOPIC => {
                check::<SubmapTopic>(table)?;
                let header: SubmapHeader = header_of(table, header)?;
                let submap = header.checked(envelope.seq)?;
                for sweep in submap.sweeps {
                    let [x, y, z, qx, qy, qz, qw] = sweep.submap_from_lidar_begin.map(f64::from);
                    let turn = geometry::UnitQuaternion::from_quaternion(geometry::Quaternion::new(qw, qx, qy, qz));
                    let in_submap = geometry::Isometry3::from_parts([x, y, z].into(), turn);
                    let name = format!("lidar{}", lidar_suffix(sweep.lidar));
                    self.transform(sweep.stamp, vec![frame(sweep.stamp, name, &(submap.odom_from_submap * in_submap))]);
                }
                self.submaps.add(envelope.seq, stamp, submap.odom_from_submap, rows);
                self.show_submaps(false);
            }
            ColorTopic::TOPIC => {
                check::<ColorTopic>(table)?;
                self.add_column(table, envelope, rows);
            }
            ClassTopic::TOPIC => {
                check::<ClassTopic>(table)?;
                self.add_column(table, envelope, rows);
            }
            InstanceTopic::TOPIC => {
                check::<InstanceTopic>(table)?;
                self.add_column(table, envelope, rows);
            }
            _ => {}
        }
        Ok(())
    }

    /// Shows the submaps that still wait for columns.
    pub fn finish(&mut self) {
        self.show_submaps(true);
    }

    fn add_column(&mut self, table: &ByteTable, envelope: &Envelope, rows: &[u8]) {
        self.submaps.add_column(&table.topic, envelope.seq, rows);
        self.show_submaps(false);
    }

    fn show_submaps(&mut self, is_end: bool) {
        while let Some(submap) = self.submaps.take(is_end) {
            let cloud = submap_cloud(submap.stamp, ODOM, &submap.odom_from_submap, &submap.points);
            self.points.log_with_time(&cloud, nanos(submap.stamp));
            let boxes = boxes(&submap, ODOM);
            if !boxes.entities.is_empty() {
                self.objects.log_with_time(&boxes, nanos(submap.stamp));
                self.n_shown += 1;
            }
            self.n_shown += 1;
        }
    }

    fn transform(&mut self, stamp: i64, transforms: Vec<FrameTransform>) {
        self.transforms.log_with_time(&FrameTransforms { transforms }, nanos(stamp));
        self.n_shown += 1;
    }
}

fn channel<T: Encode>(context: &Arc<Context>, topic: String) -> Channel<T> {
    ChannelBuilder::new(topic).context(context).build()
}

fn lidar_suffix(lidar: u32) -> String {
    if lidar == 0 { String::new() } else { format!("_{lidar}") }
}

fn nanos(stamp: i64) -> u64 {
    stamp.max(0) as u64
}

fn frame(stamp: i64, child: String, odom_from_child: &geometry::Pose) -> FrameTransform {
    let of_pose = pose(odom_from_child);
    FrameTransform {
        timestamp: Some(timestamp(stamp)),
        parent_frame_id: ODOM.to_owned(),
        child_frame_id: child,
        translation: of_pose.position,
        rotation: of_pose.orientation,
    }
}

fn jpeg(stamp: i64, header: &ImageHeader, rows: &[u8]) -> anyhow::Result<CompressedImage> {
    let ImageHeader { camera, width, height, channels, .. } = *header;
    let n_bytes = u64::from(width) * u64::from(height) * 3;
    if channels != 3 || rows.len() as u64 != n_bytes {
        bail!("image of camera {camera}: {width} x {height} with {channels} channels has {} bytes", rows.len());
    }
    let mut data = Vec::new();
    JpegEncoder::new_with_quality(&mut data, JPEG_QUALITY).encode(
        rows,
        width,
        height,
        image::ExtendedColorType::Rgb8,
    )?;
    Ok(CompressedImage {
        timestamp: Some(timestamp(stamp)),
        frame_id: format!("camera_{camera}"),
        data: Bytes::from(data),
        format: "jpeg".to_owned(),
    })
}

fn check<T: Message>(table: &ByteTable) -> anyhow::Result<()> {
    if (table.version, table.layout) != (T::VERSION, T::LAYOUT) {
        bail!(
            "topic {}: version {} with layout {:#x}; this program reads version {} with layout {:#x}",
            table.topic,
            table.version,
            table.layout,
            T::VERSION,
            T::LAYOUT
        );
    }
    Ok(())
}

fn header_of<T: Pod>(table: &ByteTable, bytes: &[u8]) -> anyhow::Result<T> {
    rows_of::<T>(table, bytes)?
        .first()
        .copied()
        .with_context(|| format!("topic {}: a message without header", table.topic))
}

fn rows_of<T: Pod>(table: &ByteTable, bytes: &[u8]) -> anyhow::Result<Vec<T>> {
    rows_from_bytes(bytes).with_context(|| format!("topic {}: {} bytes are not whole rows", table.topic, bytes.len()))
}
