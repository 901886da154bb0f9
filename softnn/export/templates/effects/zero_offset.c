/*@ ZeroOffset after */
y += {offset_MPa};
