//! All supported models.

use crate::{hesai, livox, ouster, robosense, velodyne};

/// A supported LiDAR model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// A Velodyne.
    Velodyne(velodyne::Model),
    /// A Hesai.
    Hesai(hesai::Model),
    /// An Ouster OS0, OS1 or OS2. Its metadata file has the number of beams and the packet format.
    Ouster,
    /// A Robosense.
    Robosense(robosense::Model),
    /// A Livox.
    Livox(livox::Model),
}

impl Model {
    /// All models.
    pub const ALL: [Model; 12] = [
        Model::Velodyne(velodyne::Model::Hdl32e),
        Model::Velodyne(velodyne::Model::Vlp16),
        Model::Velodyne(velodyne::Model::Vlp32c),
        Model::Velodyne(velodyne::Model::Hdl64e),
        Model::Hesai(hesai::Model::Pandar40p),
        Model::Hesai(hesai::Model::PandarXt32),
        Model::Hesai(hesai::Model::PandarQt64),
        Model::Ouster,
        Model::Robosense(robosense::Model::Rs16),
        Model::Robosense(robosense::Model::Rs32),
        Model::Livox(livox::Model::Mid360),
        Model::Livox(livox::Model::Avia),
    ];

    /// Name in `drive.toml`.
    pub const fn name(self) -> &'static str {
        match self {
            Model::Velodyne(model) => model.name(),
            Model::Hesai(model) => model.name(),
            Model::Ouster => "ouster",
            Model::Robosense(model) => model.name(),
            Model::Livox(model) => model.name(),
        }
    }

    /// Name of the manufacturer.
    pub const fn title(self) -> &'static str {
        match self {
            Model::Velodyne(model) => model.title(),
            Model::Hesai(model) => model.title(),
            Model::Ouster => "Ouster",
            Model::Robosense(model) => model.title(),
            Model::Livox(model) => model.title(),
        }
    }

    /// The model of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|model| model.name() == name)
    }

    /// The names of all models, separated by commas.
    pub fn names() -> String {
        Self::ALL.map(Model::name).join(", ")
    }

    /// Model whose data packet this is. `None` for packets of an Ouster, which do not name it.
    pub fn of_payload(payload: &[u8]) -> Option<Self> {
        if let Some(packet) = velodyne::DataPacket::new(payload) {
            return velodyne::Model::of_packet(packet).map(Model::Velodyne);
        }
        (hesai::Model::of_payload(payload).map(Model::Hesai))
            .or_else(|| robosense::Model::of_payload(payload).map(Model::Robosense))
            .or_else(|| livox::Model::of_payload(payload).map(Model::Livox))
    }

    /// Whether a payload may be a data packet of some supported LiDAR.
    pub fn may_be_data(payload: &[u8]) -> bool {
        velodyne::DataPacket::new(payload).is_some()
            || Self::of_payload(payload).is_some()
            || Self::may_be_ouster(payload)
    }

    /// Whether a payload has the size of a data packet of some Ouster.
    pub(crate) fn may_be_ouster(payload: &[u8]) -> bool {
        ouster::is_common_size(payload.len())
    }

    /// UDP port of data packets, as set by the manufacturer.
    pub const fn data_port(self) -> u16 {
        match self {
            Model::Velodyne(_) | Model::Hesai(_) => velodyne::DATA_PORT,
            Model::Ouster => ouster::DATA_PORT,
            Model::Robosense(_) => robosense::DATA_PORT,
            Model::Livox(model) => model.data_port(),
        }
    }

    /// UDP port of other packets of the sensor.
    pub(crate) const fn other_port(self) -> u16 {
        match self {
            Model::Velodyne(_) => velodyne::POSITION_PORT,
            Model::Hesai(_) => 10_110,
            Model::Ouster => ouster::IMU_PORT,
            Model::Robosense(_) => robosense::DEVICE_PORT,
            Model::Livox(model) => model.imu_port(),
        }
    }
}

impl From<velodyne::Model> for Model {
    fn from(model: velodyne::Model) -> Self {
        Model::Velodyne(model)
    }
}

impl From<hesai::Model> for Model {
    fn from(model: hesai::Model) -> Self {
        Model::Hesai(model)
    }
}

impl From<robosense::Model> for Model {
    fn from(model: robosense::Model) -> Self {
        Model::Robosense(model)
    }
}

impl From<livox::Model> for Model {
    fn from(model: livox::Model) -> Self {
        Model::Livox(model)
    }
}
