//! Multipliers of pile contacts in the rows that the rest of the core reads.

use crate::contact::Contact;
use glam::DVec3;

/// Rows of an impulse in the frame `normal`, `t1`, `t2` of the contact.
pub fn packed(c: &Contact, normal: DVec3, impulse: DVec3) -> [f64; 6] {
    let mut rows = [0.0; 6];
    rows[0] = impulse.dot(normal);
    if c.bounds.sliding > 0.0 {
        rows[1] = impulse.dot(c.t1);
        rows[2] = impulse.dot(c.t2);
    }
    rows
}

/// Turns the frame of a contact to `normal`: its position multipliers keep their components along the normal and across.
pub fn turn_frame(c: &mut Contact, normal: DVec3) {
    let across = c.nu[1] * c.t1 + c.nu[2] * c.t2;
    (c.t1, c.t2) = carom_geom::tangent_frame(normal);
    if c.bounds.sliding > 0.0 {
        (c.nu[1], c.nu[2]) = (across.dot(c.t1), across.dot(c.t2));
    }
}
