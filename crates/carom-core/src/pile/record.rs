//! Multipliers of pile contacts in the rows that the rest of the core reads.

use crate::contact::Contact;
use glam::DVec3;

/// Rows of an impulse and a moment in the frame `normal`, `t1`, `t2` of the contact.
pub fn packed(c: &Contact, normal: DVec3, impulse: DVec3, moment: DVec3) -> [f64; 6] {
    let mut rows = [0.0; 6];
    rows[0] = impulse.dot(normal);
    let mut next = 1;
    if c.bounds.sliding > 0.0 {
        rows[1] = impulse.dot(c.t1);
        rows[2] = impulse.dot(c.t2);
        next = 3;
    }
    if c.bounds.rolling > 0.0 {
        rows[next] = moment.dot(c.t1);
        rows[next + 1] = moment.dot(c.t2);
        next += 2;
    }
    if c.bounds.spinning > 0.0 {
        rows[next] = moment.dot(normal);
    }
    rows
}

/// The frame of all rows at the end of the step, where this is the normal.
pub fn set_frame(c: &mut Contact, normal: DVec3) {
    (c.t1, c.t2) = carom_geom::tangent_frame(normal);
    c.end_frame = true;
}
