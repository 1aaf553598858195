/// Part of every program that the sanitizers watch: libraries stay loaded to the end, so that what they leave has a
/// name for leaks.txt.
extern "C" int dlclose(void *) { return 0; }
