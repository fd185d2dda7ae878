"""In-process gauging: a vibrating-contact gauge, the grinding that it stops, the sizes that come out."""
