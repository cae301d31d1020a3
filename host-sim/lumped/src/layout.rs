//! Layout of the state: lanes of the chambers and indices of the nodes.

use crate::simd::WIDTH;

/// Groups of lanes for chambers: fifteen pistons on either side, padded.
pub const GROUPS: usize = 8;
/// Lanes for chambers.
pub const LANES: usize = GROUPS * WIDTH;
/// Nodes: line A, line B, charge gallery, flushing gallery.
pub const NODES: usize = 4;
/// Index of line A.
pub const LINE_A: usize = 0;
/// Index of line B.
pub const LINE_B: usize = 1;
/// Index of the charge gallery.
pub const CHARGE_GALLERY: usize = 2;
/// Index of the flushing gallery.
pub const FLUSHING_GALLERY: usize = 3;
