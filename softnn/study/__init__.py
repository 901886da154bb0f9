"""What a study of networks is made of: data, one trial, a sweep, results, figures."""
